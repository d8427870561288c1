"""Tracked speech as tensors: what the mouth does in each frame, and which sounds are said when."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from facecode.arrays import Float32
from facecode.audio import load_audio
from facecode_exporter.corpus.mouth import TYPICAL_DB
from facecode_exporter.corpus.phones import SAMPLE_RATE, covering
from facecode_exporter.corpus.prosody import frame_windows, loudness
from facecode_exporter.corpus.rules import FPS
from facecode_exporter.corpus.visemes import BY_HAND, VOWELS, split_diphthongs
from facecode_exporter.data.mouth_tracks import read_mouth_tracks
from facecode_exporter.demo.captured import teacher_weights
from facecode_exporter.head.face_units import UNIT
from facecode_exporter.head.head import Head
from facecode_exporter.head.mouth_fit import RELUCTANCE, unit_measures
from facecode_exporter.measures.phone import Phone

UNITS = tuple(RELUCTANCE)


@dataclass(frozen=True, eq=False)
class Spoken:
    """Clips of one length: what the mouth does, and the sounds, padded with dominance 0."""

    measures: Tensor
    """(n, T, 7) mm"""
    weights: Tensor
    """(n, T, 15)"""
    sounds: Tensor
    """(n, S) int64, numbers of visemes"""
    start_s: Tensor
    end_s: Tensor
    """(n, S)"""
    present: Tensor
    """(n, S) 1 or 0"""
    level_db: Tensor
    """(n, S) loudness of vowels, TYPICAL_DB for others"""


def read_spoken(data: Path, split: str, head: Head) -> tuple[Spoken, Counter[str]]:
    """The clips of a split with what the teacher makes of them, and how often each sound is said.

    Raises:
        DataSetError: files that are missing or of another form.
    """
    tracks = read_mouth_tracks(data, split)
    columns, along = [column_of(unit) for unit in UNITS], unit_measures(head)
    weights = [teacher_weights(track, head)[:, columns] for track in tracks]
    n_frames = min(map(len, weights))
    mouths = np.stack([w[:n_frames] for w in weights]).astype(np.float32)
    rows: list[list[tuple[int, float, float, float]]] = []
    names = list(BY_HAND)
    for track in tracks:
        audio = load_audio(track.track.sound, SAMPLE_RATE)
        levels = loudness(frame_windows(audio, n_frames, FPS))
        parts = split_diphthongs(covering(track.track.phones, 0.0, len(audio) / SAMPLE_RATE))
        rows.append([(names.index(p.name), p.start_s, p.end_s, _level(p, levels)) for p in parts])
    counts = Counter(names[row[0]] for clip in rows for row in clip)
    longest = max(map(len, rows))
    padded = np.array([[*clip, *[(0, 0.0, 1.0, 0.0)] * (longest - len(clip))] for clip in rows])
    present = np.array([[k < len(clip) for k in range(longest)] for clip in rows])
    plain = [torch.from_numpy(padded[..., i].astype(np.float32)) for i in (1, 2, 3)]
    sounds = torch.from_numpy(padded[..., 0].astype(np.int64))
    measures = torch.from_numpy((mouths @ along).astype(np.float32))
    seen = torch.from_numpy(present.astype(np.float32))
    start, end, level = plain
    return Spoken(measures, torch.from_numpy(mouths), sounds, start, end, seen, level), counts


def _level(phone: Phone, levels: Float32) -> float:
    own = levels[round(phone.start_s * FPS) : round(phone.end_s * FPS) + 1]
    return float(np.quantile(own, 0.75)) if phone.name in VOWELS and len(own) else TYPICAL_DB


def column_of(unit: str) -> int:
    """Where a unit of UNITS stands among all; the left one of two."""
    return UNIT[unit] if unit in UNIT else UNIT[f"{unit}Left"]
