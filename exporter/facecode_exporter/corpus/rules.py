"""Speech to the weights of the 52 face units: the label of one utterance.

Comes in: 16 kHz mono audio, its phones, a style and a seed. Goes out: (T, 52) float16 at 30 fps,
frame t at t / 30 s. The same input gives the same weights, bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Audio, Float32
from facecode_exporter.corpus.mouth import mouth_weights
from facecode_exporter.corpus.phones import SAMPLE_RATE, require_contiguous
from facecode_exporter.corpus.prosody import frame_windows, loudness, pitch
from facecode_exporter.corpus.styles import Style
from facecode_exporter.corpus.upper_face import upper_face_weights
from facecode_exporter.measures.phone import Phone

FPS = 30.0
Weights: TypeAlias = NDArray[np.float16]


def frames_in(n_samples: int) -> int:
    """How many frames a recording has."""
    return int(n_samples * FPS // SAMPLE_RATE)


def face_weights(
    audio: Audio, phones: Sequence[Phone], style: Style, seed: int | Sequence[int]
) -> Weights:
    """(T, 52) float16 in [0, 1], T = `frames_in(len(audio))`.

    Raises:
        AlignmentError: the phones have gaps.
    """
    require_contiguous(list(phones))
    windows = frame_windows(audio, frames_in(len(audio)), FPS)
    loud, high = loudness(windows), pitch(windows)
    rng = np.random.default_rng(seed)
    mouth: Float32 = mouth_weights(phones, loud, style, FPS)
    upper = upper_face_weights(phones, loud, high, style, rng, FPS)
    return np.asarray(np.clip(mouth + upper, 0, 1), np.float16)
