"""People who were filmed while they spoke: sound, tracked landmarks, and the times of sounds.

A folder holds one `*tracks.npz`, one `phones*.json` and the sound, `NAME.flac` or `NAME.wav`, in
the folder or in `flac/`; NAME is `SPEAKER_CLIP`. The archive has, all clips one after the other:
`landmarks_px32` (n, L, 3) int16 in 1/32 pixel with `landmark_index` (L,) of MediaPipe's face mesh,
`start` and `length` of each clip in rows, `clip`, `speaker`, and `fps`. The JSON has, by NAME,
lists of [sound, start s, end s, ...], ARPABET or SIL.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facecode_exporter.errors import DataSetError
from facecode_exporter.measures.phone import Phone

UPPER_LIP, LOWER_LIP, CORNERS, EYE_CORNERS = 13, 14, (61, 291), (33, 263)
"""Numbers of MediaPipe's face mesh: inner lips on the midline, corners of mouth and eyes."""
EYES_MM = 90.0
"""Distance of the outer eye corners, which gives films their scale."""
SPLITS = ("train", "validation", "test", "others")
HELD_OUT_EVERY, TEST_FROM = 10, 5

Curve = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Track:
    """One clip of one person; frame k shows the moment (k + 0.5) / fps."""

    name: str
    speaker: str
    sound: Path
    fps: float
    gap_mm: Curve
    """(T,) between the inner lips on the midline"""
    width_mm: Curve
    """(T,) between the corners of the mouth"""
    phones: tuple[Phone, ...]


def read_tracks(folder: Path, split: str) -> list[Track]:
    """The clips of a split, in order of name.

    The speaker with the most clips is split in order of name: every tenth clip is validation, every
    tenth from the fifth on test, the rest train. All other speakers are `others`, a test.

    Raises:
        DataSetError: files that are missing or of another form.
    """
    archive, phones = find_archive(folder), _one(folder, "phones*.json")
    try:
        said = json.loads(phones.read_text(encoding="utf-8"))
        with np.load(archive, allow_pickle=False) as data:
            names = [f"{s}_{c}" for s, c in zip(data["speaker"], data["clip"], strict=True)]
            chosen = _split(names, data["speaker"].tolist(), split)
            where = {int(n): i for i, n in enumerate(data["landmark_index"])}
            picked = [where[n] for n in (UPPER_LIP, LOWER_LIP, *CORNERS, *EYE_CORNERS)]
            points = data["landmarks_px32"][:, picked, :2].astype(np.float64)
            fps, starts, lengths = float(data["fps"]), data["start"], data["length"]
    except (KeyError, ValueError, OSError) as error:
        raise DataSetError(
            f"{folder} does not have the form of tracked speech ({error}); see docs/evaluation.md"
        ) from error
    tracks = []
    for i in chosen:
        rows = points[starts[i] : starts[i] + lengths[i]]
        gap, width = _curves(rows)
        times = tuple(Phone(*phone[:3]) for phone in said.get(names[i], ()))
        speaker = names[i].partition("_")[0]
        tracks.append(Track(names[i], speaker, _sound(folder, names[i]), fps, gap, width, times))
    if not tracks:
        raise DataSetError(f"{folder} has no clip in the split {split!r}")
    return tracks


def _split(names: Sequence[str], speakers: Sequence[str], split: str) -> list[int]:
    if split not in SPLITS:
        raise DataSetError(f"got the split {split!r}; expected one of {', '.join(SPLITS)}")
    main = max(sorted(set(speakers)), key=speakers.count)
    own = sorted((i for i, s in enumerate(speakers) if s == main), key=lambda i: names[i])
    validation, test = own[::HELD_OUT_EVERY], own[TEST_FROM::HELD_OUT_EVERY]
    if split == "others":
        return sorted(set(range(len(names))) - set(own), key=lambda i: names[i])
    if split == "train":
        return [i for i in own if i not in {*validation, *test}]
    return test if split == "test" else validation


def _curves(points: Curve) -> tuple[Curve, Curve]:
    """Gap and width in mm of points (T, 6, 2): lips, corners of the mouth, corners of the eyes."""
    apart = np.linalg.norm(points[:, 1::2] - points[:, ::2], axis=2)
    scaled = apart[:, :2] * (EYES_MM / apart[:, 2:])
    return scaled[:, 0], scaled[:, 1]


def find_archive(folder: Path) -> Path:
    """The tracks of a folder.

    Raises:
        DataSetError: none, or several.
    """
    return _one(folder, "*tracks.npz")


def _one(folder: Path, pattern: str) -> Path:
    found = sorted(path for path in folder.glob(pattern) if not path.name.startswith("."))
    if len(found) != 1:
        raise DataSetError(f"{folder} has {len(found)} files {pattern}; expected one")
    return found[0]


def _sound(folder: Path, name: str) -> Path:
    for path in (folder / "flac" / f"{name}.flac", folder / f"{name}.flac", folder / f"{name}.wav"):
        if path.is_file():
            return path
    raise DataSetError(f"{folder} has no sound for {name}: expected {name}.flac or .wav")
