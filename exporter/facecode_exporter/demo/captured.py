"""Clips of tracked people for the demo corpus: their sound, and the demo head moving as they did.

Comes in: a folder of tracked people and a corpus. Goes out: more clips of the style `natural`, the
speaker's training clips in `train` and some of his others in `val`. Lips and jaw are his; brows,
eyes and blinks are by rule, for read prompts teach no upper face. So that a model does not bind
his motion to his voice, most clips are played faster or slower, sound and motion alike, and all are
heard through rooms and microphones. Sound and tracks stay where they are; the corpus is a copy.
"""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from facecode.arrays import Audio, Float32
from facecode.audio import load_audio
from facecode_exporter.corpus.files import clip_path, load_about
from facecode_exporter.corpus.phones import SAMPLE_RATE, covering
from facecode_exporter.corpus.prosody import frame_windows, loudness, pitch
from facecode_exporter.corpus.room_acoustics import recorded
from facecode_exporter.corpus.rules import FPS
from facecode_exporter.corpus.styles import style_named
from facecode_exporter.corpus.upper_face import upper_face_weights
from facecode_exporter.corpus.utterance import Utterance
from facecode_exporter.corpus.writing import FIRST_ADDED, write_added, write_clip
from facecode_exporter.data.mouth_tracks import MouthTrack, read_mouth_tracks
from facecode_exporter.head.head import Head, load_head
from facecode_exporter.head.mouth_fit import fit_mouth
from facecode_exporter.measures.phone import Phone

STYLE = "natural"
SPLITS = {"train": "train", "validation": "val"}
SHARE_AS_FILMED = 0.3
SLOWEST, FASTEST = 0.82, 1.22
SHARE_RECORDED = 0.7


def add_captured(data: Path, corpus: Path, progress: bool = True) -> int:
    """Add the clips of `data` to the corpus; those that are there stay. Gives how many there are.

    Raises:
        DataSetError: files of `data` that are missing or of another form.
        CorpusError: no corpus.
    """
    from tqdm import tqdm

    load_about(corpus)
    head, number = load_head(), FIRST_ADDED
    names: dict[str, list[str]] = {}
    for split, own in SPLITS.items():
        names[own] = []
        tracks = read_mouth_tracks(data, split)
        for mouth in tqdm(tracks, desc=f"captured {own}", disable=not progress):
            name = f"{STYLE}_{number:05d}"
            if not clip_path(corpus, "weights", name).is_file():
                utterance, weights = captured_clip(mouth, head)
                write_clip(corpus, name, utterance, weights)
            names[own].append(name)
            number += 1
    write_added(corpus, names)
    return sum(map(len, names.values()))


def captured_clip(mouth: MouthTrack, head: Head) -> tuple[Utterance, Float32]:
    """One clip as the corpus holds it; the same track gives the same clip."""
    track = mouth.track
    rng = np.random.default_rng(zlib.crc32(track.name.encode()))
    filmed, drawn = rng.random() < SHARE_AS_FILMED, np.exp(rng.uniform(*np.log((SLOWEST, FASTEST))))
    rate = SAMPLE_RATE if filmed else round(SAMPLE_RATE * drawn)
    pace = rate / SAMPLE_RATE
    audio = load_audio(load_audio(track.sound, SAMPLE_RATE), SAMPLE_RATE, rate)
    lips = teacher_weights(mouth, head, pace)
    audio = audio[: -(-len(lips) * SAMPLE_RATE // round(FPS))]
    if rng.random() < SHARE_RECORDED:
        audio = recorded(audio, rng)
    times = [Phone(p.name, p.start_s / pace, p.end_s / pace) for p in track.phones]
    phones = covering(times, 0.0, len(audio) / SAMPLE_RATE)
    weights = lips + _upper_face(audio, phones, len(lips), rng)
    return Utterance("", track.speaker, audio, phones), np.clip(weights, 0, 1)


def teacher_weights(mouth: MouthTrack, head: Head, pace: float = 1.0) -> Float32:
    """(T, 52) weights of lips and jaw at FPS; frame t is the moment t / FPS.

    Args:
        mouth: (n, 7) measures, frame k at (k + 0.5) / fps; cubic between frames.
        head: the demo head.
        pace: how much faster than the film.
    """
    from scipy.interpolate import CubicSpline

    fps = mouth.track.fps * pace
    shown = (np.arange(len(mouth.measures_mm)) + 0.5) / fps
    times = np.clip(np.arange(int(len(shown) / fps * FPS)) / FPS, shown[0], shown[-1])
    measures = CubicSpline(shown, mouth.measures_mm)(times)
    measures[:, 0] = np.maximum(measures[:, 0], 0)
    return fit_mouth(measures, CubicSpline(shown, mouth.rounding)(times), head)


def _upper_face(
    audio: Audio, phones: list[Phone], n_frames: int, rng: np.random.Generator
) -> Float32:
    windows = frame_windows(audio, n_frames, FPS)
    loud, high = loudness(windows), pitch(windows)
    return upper_face_weights(phones, loud, high, style_named(STYLE), rng, FPS)
