"""Clips of speech and motion, from the folders that people hold.

    VOCASET, BIWI   vertices_npy/<subject>_<sentence>.npy (frames, 3V), wav/<same>.wav,
                    templates.pkl {subject: (V, 3)}

Goes out: offsets from the subject's template (T, 3V) and audio, clip by clip, read when asked for.
Splits are those of CodeTalker (section 4.1).
"""

from __future__ import annotations

import pickle
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np

from facecode.arrays import AnyArray, Audio, Float32
from facecode.audio import load_audio
from facecode_exporter.errors import DataError
from facecode_spec.systems import codetalker_biwi, codetalker_vocaset

Split = Literal["train", "val", "test"]


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


@dataclass(frozen=True)
class Layout:
    """How a published data set is cut and named."""

    train_subjects: tuple[str, ...]
    other_subjects: dict[Split, tuple[str, ...]]
    """Unseen subjects of the other splits; none: the training subjects on other sentences."""
    sentence_pattern: str
    sentences: dict[Split, range]
    keep_every: int
    """60 frames a second become 30 by taking every second one (VOCASET)."""

    def subjects(self, split: Split) -> tuple[str, ...]:
        """Subjects of a split."""
        return self.other_subjects.get(split, self.train_subjects)


LAYOUTS = {
    "vocaset": Layout(
        train_subjects=codetalker_vocaset.SPEC.styles,
        other_subjects={
            "val": ("FaceTalk_170811_03275_TA", "FaceTalk_170908_03277_TA"),
            "test": ("FaceTalk_170809_00138_TA", "FaceTalk_170731_00024_TA"),
        },
        sentence_pattern=r"sentence(\d+)",
        sentences={"train": range(1, 41), "val": range(21, 41), "test": range(21, 41)},
        keep_every=2,
    ),
    "BIWI": Layout(
        train_subjects=codetalker_biwi.SPEC.styles,
        other_subjects={},
        sentence_pattern=r"e?(\d+)",
        sentences={"train": range(1, 33), "val": range(33, 37), "test": range(37, 41)},
        keep_every=1,
    ),
}


class FolderClips:
    """One split of a VOCASET or BIWI folder."""

    def __init__(self, root: Path, layout: Layout, split: Split, n_vertices: int) -> None:
        """Find the clips.

        Raises:
            DataError: a folder or file of the layout is missing, or the split is empty.
        """
        self.root, self.layout, self.n_vertices = root, layout, n_vertices
        for needed in ("vertices_npy", "wav", "templates.pkl"):
            if not (root / needed).exists():
                raise DataError(
                    f"{root} has no {needed}; expected vertices_npy/, wav/ and templates.pkl"
                )
        files = sorted((root / "vertices_npy").glob("*.npy"))
        self.names = [f.stem for f in files if self._belongs(f.stem, split)]
        if not self.names:
            raise DataError(
                f"{root / 'vertices_npy'} has no clip of the {split} split; expected "
                f"<subject>_<sentence>.npy with subjects {', '.join(layout.subjects(split))}"
            )

    def _belongs(self, name: str, split: Split) -> bool:
        subject, _, sentence = name.rpartition("_")
        number = re.fullmatch(self.layout.sentence_pattern, sentence)
        return (
            number is not None
            and int(number[1]) in self.layout.sentences[split]
            and subject in self.layout.subjects(split)
        )

    @cached_property
    def templates(self) -> dict[str, AnyArray]:
        """Neutral faces (V, 3) by subject."""
        return read_templates(self.root / "templates.pkl")

    def offsets(self, index: int) -> Float32:
        """(T, 3V).

        Raises:
            DataError: another number of vertices, or no template for the subject.
        """
        name = self.names[index]
        subject = name.rpartition("_")[0]
        if subject not in self.templates:
            raise DataError(f"templates.pkl has no template for {subject}")
        try:
            vertices = np.load(self.root / "vertices_npy" / f"{name}.npy", allow_pickle=False)
        except (OSError, ValueError) as error:
            raise DataError(f"vertices_npy/{name}.npy cannot be read: {error}") from error
        flat = vertices[:: self.layout.keep_every].reshape(-1, vertices[0].size)
        template = self.templates[subject].reshape(-1)
        if flat.shape[1] != 3 * self.n_vertices or template.size != 3 * self.n_vertices:
            raise DataError(
                f"{name} has {flat.shape[1] // 3} vertices and a template of "
                f"{template.size // 3}; this system has {self.n_vertices}"
            )
        return np.asarray(flat - template, dtype=np.float32)

    def audio(self, index: int) -> Audio:
        """(n_samples,) at 16 kHz."""
        return load_audio(self.root / "wav" / f"{self.names[index]}.wav", 16_000)

    def style(self, index: int) -> int:
        """Index of the subject among the training subjects; 0 for an unseen one."""
        subject = self.names[index].rpartition("_")[0]
        known = self.layout.train_subjects
        return known.index(subject) if subject in known else 0


ARRAY_CLASSES = {
    ("multiarray", "_reconstruct"),
    ("multiarray", "scalar"),
    ("numpy", "ndarray"),
    ("numpy", "dtype"),
    ("_codecs", "encode"),
}


class _ArraysOnly(pickle.Unpickler):
    """Admits numpy arrays; any other class in the file is an error, not code that runs."""

    def find_class(self, module: str, name: str) -> Any:  # noqa: ANN401
        if (module.rpartition(".")[2], name) not in ARRAY_CLASSES:
            raise pickle.UnpicklingError(f"{module}.{name} is not an array")
        return super().find_class(module.replace("numpy.core", "numpy._core"), name)


def read_templates(path: Path) -> dict[str, AnyArray]:
    """A Python-2 pickle {subject: (V, 3)}, without running code from it.

    Raises:
        DataError: not such a file.
    """
    try:
        with path.open("rb") as file:
            content = _ArraysOnly(file, encoding="latin1").load()
        return {str(name): np.asarray(array, dtype=np.float64) for name, array in content.items()}
    except Exception as error:  # a broken pickle can raise anything
        raise DataError(f"{path} is not a pickle of templates: {error}") from error


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
