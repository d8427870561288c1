"""Captured faces on disk, in the layout of VOCASET and BIWI that the public code reads.

    vertices_npy/<subject>_<sentence>.npy   (T, 3V)
    wav/<subject>_<sentence>.wav            what is said
    templates.pkl                           {subject: (V, 3)}, a Python-2 pickle

Comes in: a folder and what it is. Goes out: clips by name, truth (T, V, 3) at the rate of the
model, templates. Knows nothing of predictions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from facecode.arrays import AnyArray, Template
from facecode_exporter.data.array_pickle import read_array_pickle
from facecode_exporter.data.motion_files import read_motion
from facecode_exporter.errors import DataSetError
from facecode_spec.systems import SYSTEMS

ALL, CORPUS = "all", "corpus"
TRUTH, TEMPLATES, SPEECH = "vertices_npy", "templates.pkl", "wav"
SPEECH_SUFFIXES = (".wav", ".flac")


class Split(NamedTuple):
    """Which clips: subjects, and the numbers that end the names of their sentences."""

    subjects: tuple[str, ...]
    sentences: range


@dataclass(frozen=True)
class Layout:
    """What a data set is: its rate, the styles that models learn from it, and its splits."""

    fps: float | None = None
    """of the motion that models give; None: any"""
    every: int = 1
    """truth frames per model frame: VOCASET is stored at 60 fps and learned at 30"""
    seen: tuple[str, ...] = ()
    """subjects of the training set, which are the styles of a model"""
    splits: Mapping[str, Split] = field(default_factory=dict)

    @property
    def split_names(self) -> tuple[str, ...]:
        """The first one is what published numbers are computed on."""
        return (*self.splits, ALL)


_VOCASET, _BIWI = SYSTEMS["codetalker-vocaset"], SYSTEMS["codetalker-biwi"]
_VOCASET_HELD_OUT = {
    "test": ("FaceTalk_170809_00138_TA", "FaceTalk_170731_00024_TA"),
    "validation": ("FaceTalk_170811_03275_TA", "FaceTalk_170908_03277_TA"),
}
_BIWI_UNSEEN = ("F1", "F5", "F6", "F7", "F8", "M1", "M2", "M6")

LAYOUTS: Mapping[str, Layout] = {
    "vocaset": Layout(
        fps=_VOCASET.fps,
        every=2,
        seen=_VOCASET.styles,
        splits={
            **{name: Split(who, range(21, 41)) for name, who in _VOCASET_HELD_OUT.items()},
            "train": Split(_VOCASET.styles, range(1, 41)),
        },
    ),
    "biwi": Layout(
        fps=_BIWI.fps,
        seen=_BIWI.styles,
        splits={
            "test-a": Split(_BIWI.styles, range(37, 41)),
            "test-b": Split(_BIWI_UNSEEN, range(37, 41)),
            "validation": Split(_BIWI.styles, range(33, 37)),
            "train": Split(_BIWI.styles, range(1, 33)),
        },
    ),
    "plain": Layout(),
    CORPUS: Layout(
        fps=SYSTEMS["codetalker-demo"].fps,
        seen=SYSTEMS["codetalker-demo"].styles,
        splits={name: Split((), range(0)) for name in ("test", "val", "train")},
    ),
}
"""`plain`: the same folders, any subjects, every clip, truth at the rate of the model. `corpus`: a
generated corpus, which says itself which clip is in which split; see `corpus_data`."""


def layout_of(name: str, styles: Sequence[str]) -> Layout:
    """The layout `name` for a system of these styles: they are the subjects that it learns from.

    Splits of the training subjects hold the clips of `styles`; those of others are as published.
    """
    published = LAYOUTS[name]
    splits = {
        split: Split(tuple(styles), found.sentences) if found.subjects == published.seen else found
        for split, found in published.splits.items()
    }
    return replace(published, seen=tuple(styles), splits=splits)


@dataclass(frozen=True)
class DataSet:
    """An opened data set: the clips of one split."""

    root: Path
    layout: Layout
    clips: tuple[str, ...]
    """`<subject>_<sentence>`, sorted"""
    templates: Mapping[str, AnyArray]

    @classmethod
    def open(cls, root: Path, layout: Layout, split: str | None = None) -> DataSet:
        """Find the clips of `split` (default: the layout's first).

        Raises:
            DataSetError: a folder or file is missing, no such split, no clips, or a clip of a
                subject without a template.
        """
        split = layout.split_names[0] if split is None else split
        if split not in layout.split_names:
            raise DataSetError(
                f"got split {split!r}; expected one of {', '.join(layout.split_names)}"
            )
        folder = root / TRUTH
        if not folder.is_dir():
            raise DataSetError(
                f"{root} has no folder {TRUTH}; expected {TRUTH}/<subject>_<sentence>.npy, "
                f"{SPEECH}/ and {TEMPLATES}"
            )
        stems = (file.stem for file in folder.glob("[!.]*.npy"))  # macOS leaves ._NAME beside each
        clips = tuple(sorted(n for n in stems if split == ALL or _within(n, layout.splits[split])))
        if not clips:
            raise DataSetError(f"{folder} has no clip of split {split!r}; check the file names")
        templates = read_array_pickle(root / TEMPLATES)
        if unknown := sorted({subject_of(n) for n in clips} - set(templates)):
            raise DataSetError(
                f"{root / TEMPLATES} has no template of {', '.join(unknown)}; "
                f"it has {', '.join(sorted(templates)) or 'none'}"
            )
        return cls(root, layout, clips, templates)

    def template(self, clip: str) -> Template:
        """The neutral face (V, 3) float32 of the clip's subject.

        Raises:
            DataSetError: an array of another shape.
        """
        array = self.templates[subject_of(clip)]
        if array.size == 0 or array.size % 3 or array.ndim > 2:
            raise DataSetError(
                f"the template of {subject_of(clip)} has shape {array.shape}; expected (V, 3)"
            )
        return np.ascontiguousarray(array.reshape(-1, 3), dtype=np.float32)

    def truth(self, clip: str) -> AnyArray:
        """Captured vertices (T, V, 3) at the rate of the model.

        Raises:
            EvaluationError: unreadable, or not in the topology of the template.
        """
        path = self.root / TRUTH / f"{clip}.npy"
        return read_motion(path, len(self.template(clip)))[:: self.layout.every]

    def speech(self, clip: str) -> Path:
        """The recording of a clip.

        Raises:
            DataSetError: there is none.
        """
        path = self._speech(clip)
        if path is None:
            raise DataSetError(
                f"{self.root / SPEECH} has no {clip}.wav; animating needs the speech"
            )
        return path

    def has_speech(self, clip: str) -> bool:
        """Whether there is a recording of a clip."""
        return self._speech(clip) is not None

    def _speech(self, clip: str) -> Path | None:
        files = (self.root / SPEECH / f"{clip}{suffix}" for suffix in SPEECH_SUFFIXES)
        return next((file for file in files if file.is_file()), None)


def subject_of(clip: str) -> str:
    """`F2_e37` -> `F2`: everything before the last underscore."""
    return clip.rpartition("_")[0]


def _within(clip: str, split: Split) -> bool:
    number = clip[-2:]
    return (
        subject_of(clip) in split.subjects and number.isdigit() and int(number) in split.sentences
    )
