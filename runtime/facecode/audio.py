"""Audio of any kind to what the speech encoder hears.

Comes in: a file, a stream or an array. Goes out: mono float32 at the model's rate, finite and long
enough for one frame. Knows nothing of bundles or graphs.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeAlias

import numpy as np

from facecode.arrays import AnyArray, Audio
from facecode.errors import (
    AudioNotFoundError,
    AudioTooShortError,
    EmptyAudioError,
    NonFiniteAudioError,
    UnreadableAudioError,
)

SPEECH = Path(__file__).parent / "assets" / "speech.flac"
"""The packaged recording; see LICENSE-speech.txt beside it."""

BLOCK = 1 << 20
"""Samples whose squares are held at once."""

AudioSource: TypeAlias = "str | os.PathLike[str] | BinaryIO | AnyArray"


def load_audio(source: AudioSource, rate: int, array_rate: int | None = None) -> Audio:
    """Mono float32 (n_samples,) at `rate` Hz.

    Args:
        source: a file that libsndfile reads (wav, flac, ogg, mp3, ...), an open binary file, or an
            array (n,) or (n, n_channels) of floats in [-1, 1] or of signed integers.
        rate: the rate to deliver.
        array_rate: the rate of an array; `rate` when not given. Files know their own.

    Raises:
        AudioNotFoundError, UnreadableAudioError, EmptyAudioError, NonFiniteAudioError.
    """
    if isinstance(source, np.ndarray):
        samples, source_rate = _as_float(source), array_rate or rate
    else:
        samples, source_rate = _read(source)
    if samples.size == 0:
        raise EmptyAudioError("the audio has no samples; give at least one frame of sound")
    if not np.isfinite(samples).all():
        n_bad = int(samples.size - np.isfinite(samples).sum())
        raise NonFiniteAudioError(
            f"{n_bad} of {samples.size} audio samples are NaN or infinite; repair the recording"
        )
    mono = samples if samples.ndim == 1 else samples.mean(axis=1, dtype=np.float32)
    if source_rate != rate:
        import soxr

        mono = soxr.resample(mono, source_rate, rate, quality="HQ")
    return np.ascontiguousarray(mono, dtype=np.float32)


def normalise(audio: Audio) -> Audio:
    """Zero mean and unit variance over the clip, as wav2vec 2.0 was trained on; see `Level`."""
    return Level.of(audio).apply(audio)


@dataclass(frozen=True)
class Level:
    """Mean and deviation of a clip, to normalise all of it or a piece at a time.

    `(x - mean) / sqrt(var + 1e-7)` with the population variance; sums in float64, so that an
    hour of audio is as exact as a second. Silence stays zero.
    """

    mean: np.float64
    deviation: np.float64

    @classmethod
    def of(cls, audio: Audio) -> Level:
        """Measure a clip (n_samples,)."""
        blocks = range(0, len(audio), BLOCK)
        mean = sum(audio[i : i + BLOCK].sum(dtype=np.float64) for i in blocks) / len(audio)
        squares = (np.square(audio[i : i + BLOCK] - mean, dtype=np.float64) for i in blocks)
        variance = sum(block.sum() for block in squares) / len(audio)
        return cls(np.float64(mean), np.sqrt(np.float64(variance) + 1e-7))

    def apply(self, audio: Audio) -> Audio:
        """The clip, or a piece of it, normalised."""
        normalised: Audio = ((audio - self.mean) / self.deviation).astype(np.float32)
        return normalised


def require_one_frame(audio: Audio, rate: int, min_samples: int) -> None:
    """Refuse audio that is too short for a single frame.

    Raises:
        AudioTooShortError
    """
    if len(audio) < min_samples:
        raise AudioTooShortError(
            f"the audio is {1000 * len(audio) / rate:.1f} ms long; one frame needs "
            f"{1000 * min_samples / rate:.1f} ms ({min_samples} samples at {rate} Hz)"
        )


def _read(source: str | os.PathLike[str] | BinaryIO) -> tuple[AnyArray, int]:
    import soundfile

    name = "the audio stream"
    if isinstance(source, (str, os.PathLike)):
        name = os.fspath(source)
        if not Path(source).is_file():
            what = "is a folder, not an audio file" if Path(source).is_dir() else "does not exist"
            raise AudioNotFoundError(f"{name} {what}")
    try:
        samples, rate = soundfile.read(source, dtype="float32", always_2d=True)
    except (soundfile.LibsndfileError, RuntimeError, TypeError) as error:
        reason = getattr(error, "error_string", str(error)).strip()
        raise UnreadableAudioError(
            f"{name} is not audio that libsndfile reads ({reason}); "
            "convert it to wav, flac, ogg or mp3"
        ) from error
    return samples, int(rate)


def _as_float(samples: AnyArray) -> AnyArray:
    if samples.ndim not in (1, 2):
        raise UnreadableAudioError(
            f"audio array has shape {samples.shape}; expected (n,) or (n, n_channels)"
        )
    if np.issubdtype(samples.dtype, np.signedinteger):
        return (samples / -float(np.iinfo(samples.dtype).min)).astype(np.float32)
    if not np.issubdtype(samples.dtype, np.floating):
        raise UnreadableAudioError(
            f"audio array is {samples.dtype}; expected floats in [-1, 1] or signed integers"
        )
    return samples.astype(np.float32)
