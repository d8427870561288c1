"""The speech of a clip as a file in memory, 16 bits a sample, for formats that hold it."""

from __future__ import annotations

import io
from typing import Literal

import numpy as np

from facecode.clip import Clip

BLOCK = 1 << 16
"""Samples: an hour is not copied as a whole."""
LOUDEST = 1 - 2**-15


def speech_of(clip: Clip, kind: Literal["FLAC", "WAV"]) -> bytes | None:
    """The bytes of a sound file, mono, lossless to 16 bits; None where there is no speech."""
    if clip.audio is None or clip.sample_rate is None:
        return None
    import soundfile

    sound = io.BytesIO()
    with soundfile.SoundFile(sound, "w", clip.sample_rate, 1, "PCM_16", format=kind) as file:
        for start in range(0, len(clip.audio), BLOCK):
            file.write(np.clip(clip.audio[start : start + BLOCK], -1, LOUDEST))
    return sound.getvalue()
