"""Clips of speech and motion for training, and how an epoch cuts them into batches."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Audio, Float32, Indices
from facecode.audio import load_audio
from facecode_exporter.data.data_set import DataSet, layout_of, subject_of
from facecode_exporter.errors import DataSetError
from facecode_exporter.measures.lip_sync import opening_curve
from facecode_exporter.measures.openings import open_frames
from facecode_spec.schema import SystemSpec

SAMPLE_RATE = 16_000


class Clips(Protocol):
    """A split of a data set."""

    @property
    def names(self) -> Sequence[str]:
        """Clip names, in a fixed order."""

    def offsets(self, index: int) -> Float32:
        """(T, 3V) offsets from the template, at the system's fps."""

    def audio(self, index: int) -> Audio:
        """(n_samples,) at the system's sample rate."""

    def style(self, index: int) -> int:
        """The clip's style, as an index into the system's styles."""


class PartClips(Clips, Protocol):
    """Clips whose offsets are those of one part of the face."""

    def open_mouth(self, closed_below: float) -> Sequence[NDArray[np.bool_]]:
        """(T,) of each clip: whether the true mouth is open; see `openings.open_frames`."""


class FolderClips:
    """One split of a VOCASET or BIWI folder, read clip by clip when asked for."""

    def __init__(self, root: Path, layout: str, split: str, system: SystemSpec) -> None:
        """Find the clips that have both motion and speech, as the public code does.

        Args:
            root: the data set.
            layout: a name of LAYOUTS.
            split: of the layout; clips of the training subjects are those of the system's styles.
            system: which is to learn them.

        Raises:
            DataSetError: not in the layout, or the split is empty.
        """
        self.styles = system.styles
        self.data = DataSet.open(root, layout_of(layout, self.styles), split)
        self.names = paired(self.data)
        self.n_vertices = system.n_vertices
        spoken = {subject_of(name) for name in self.names}
        if split == "train" and (silent := [name for name in self.styles if name not in spoken]):
            print(
                f"{root} has no clip of {', '.join(silent)}: these styles learn nothing",
                file=sys.stderr,
            )

    def offsets(self, index: int) -> Float32:
        """(T, 3V).

        Raises:
            DataSetError: unreadable, or of another number of vertices.
        """
        name = self.names[index]
        template = self.data.template(name)
        if len(template) != self.n_vertices:
            raise DataSetError(
                f"{name} has {len(template)} vertices; this system has {self.n_vertices}"
            )
        motion = self.data.truth(name) - template
        return np.asarray(motion.reshape(len(motion), -1), dtype=np.float32)

    def audio(self, index: int) -> Audio:
        """(n_samples,) at 16 kHz."""
        return load_audio(self.data.speech(self.names[index]), SAMPLE_RATE)

    def style(self, index: int) -> int:
        """Index of the subject among the system's styles; 0 for an unseen one."""
        subject = subject_of(self.names[index])
        return self.styles.index(subject) if subject in self.styles else 0


class FolderPart:
    """The motion of one part of the face in a split, and when its mouth is open."""

    def __init__(self, clips: FolderClips, vertices: Indices, lip_pair: tuple[int, int]) -> None:
        """Choose the part.

        Args:
            clips: whole faces.
            vertices: (n,) those of the part.
            lip_pair: an upper-lip and a lower-lip vertex of the whole face.
        """
        self.clips, self.lip_pair = clips, lip_pair
        self.names = clips.names
        self._columns = (3 * vertices[:, None] + np.arange(3)).ravel()

    def offsets(self, index: int) -> Float32:
        """(T, 3n)."""
        return self.clips.offsets(index)[:, self._columns]

    def audio(self, index: int) -> Audio:
        """(n_samples,) at 16 kHz."""
        return self.clips.audio(index)

    def style(self, index: int) -> int:
        """As of the whole face."""
        return self.clips.style(index)

    def open_mouth(self, closed_below: float) -> Sequence[NDArray[np.bool_]]:
        """(T,) of each clip: True where the true mouth is open."""
        data = self.clips.data
        openings = [
            opening_curve(data.truth(name), self.lip_pair, data.template(name))
            for name in self.names
        ]
        return open_frames(openings, [subject_of(name) for name in self.names], closed_below)


def paired(data: DataSet) -> tuple[str, ...]:
    """The clips that have speech; those left out are told on stderr, with their number.

    Raises:
        DataSetError: none has.
    """
    spoken = tuple(name for name in data.clips if data.has_speech(name))
    if not spoken:
        raise DataSetError(f"{data.root} has no wav of any of its {len(data.clips)} clips")
    if alone := [name for name in data.clips if name not in set(spoken)]:
        shown = ", ".join(alone[:5]) + (", ..." if len(alone) > 5 else "")
        print(f"{len(alone)} clips without a wav are left out: {shown}", file=sys.stderr)
    return spoken


def lessons_of(clips: Clips) -> Iterator[Float32]:
    """What tells one split from another: names, styles, and the first and the last motion."""
    for i, name in enumerate(clips.names):
        yield np.array([*name.encode(), clips.style(i)], np.float32)
    for i in (0, len(clips.names) - 1):
        yield clips.offsets(i)


def batches(
    lengths: Sequence[int], batch_size: int, crop: int | None, rng: np.random.Generator
) -> list[list[tuple[int, int, int]]]:
    """One epoch of (clip, first frame, frames); the clips of a batch are cut to equal lengths.

    Clips are shuffled, then sorted by length within stretches of 16 batches, so that a cut
    loses little; batches come in random order.
    """
    order = rng.permutation(len(lengths))
    stretch = 16 * batch_size
    groups: list[list[int]] = []
    for start in range(0, len(order), stretch):
        near = sorted(order[start : start + stretch].tolist(), key=lambda i: lengths[i])
        groups += [near[i : i + batch_size] for i in range(0, len(near), batch_size)]
    epoch = []
    for index in rng.permutation(len(groups)):
        group = groups[index]
        size = min(min(lengths[i] for i in group), crop or 2**31)
        starts = [int(rng.integers(0, lengths[i] - size + 1)) for i in group]
        epoch.append([(i, start, size) for i, start in zip(group, starts, strict=True)])
    return epoch
