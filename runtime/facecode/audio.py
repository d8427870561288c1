"""Audio of any kind to what the speech encoder hears.

Comes in: a file, a pipe, a stream or an array. Goes out: mono float32 at the model's rate, finite.
Trusts no header: a recording is as long as what can be decoded of it. Knows nothing of bundles or
graphs.
"""

from __future__ import annotations

import io
import os
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias, cast

import numpy as np

from facecode.arrays import AnyArray, Audio
from facecode.errors import (
    AudioNotFoundError,
    AudioWarning,
    EmptyAudioError,
    NonFiniteAudioError,
    UnreadableAudioError,
)
from facecode.wording import one_line

SPEECH = Path(__file__).parent / "assets" / "speech.flac"
"""The packaged recording; see LICENSE-speech.txt beside it."""

BLOCK = 1 << 20
"""Samples that are read and mixed at once."""
LOUDEST = 16.0
"""Floats beyond it are no samples in [-1, 1], however hot the recording."""
CANCELLED = 1e-4
"""Share of the channels' energy below which their mix is called silent: -40 dB."""
MOST_CHANNELS = 64
QUIETEST_PEAK = 1 << 15
"""int32 samples that stay below are 96 dB under full scale: values of 16 bits in a wider type."""

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

    Warns:
        AudioWarning: channels of opposite phase, which cancel each other.
    """
    if isinstance(source, np.ndarray):
        source_rate, blocks = array_rate or rate, iter([as_float(source)])
    else:
        source_rate, blocks = _read(source, BLOCK)
    mono = _joined(_resampled(_mixed(blocks), source_rate, rate))
    if not len(mono):
        raise EmptyAudioError("the audio has no samples; give at least one frame of sound")
    return mono


def _mixed(blocks: Iterator[AnyArray]) -> Iterator[Audio]:
    """Blocks (n, n_channels) or (n,) as mono, checked."""
    n_samples = n_bad = 0
    peak = of_channels = of_mix = 0.0
    for block in blocks:
        n_samples += block.size
        n_bad += block.size - int(np.isfinite(block).sum())
        if n_bad:
            continue
        mono = block if block.ndim == 1 else block.mean(axis=1, dtype=np.float32)
        peak = max(peak, float(np.abs(block).max(initial=0)))
        of_channels += (
            float(np.square(block, dtype=np.float64).sum()) * len(mono) / max(block.size, 1)
        )
        of_mix += float(np.square(mono, dtype=np.float64).sum())
        yield np.ascontiguousarray(mono, dtype=np.float32)
    if n_bad:
        raise NonFiniteAudioError(
            f"{n_bad} of {n_samples} audio samples are NaN or infinite; repair the recording"
        )
    if peak > LOUDEST:
        raise UnreadableAudioError(
            f"the audio has samples up to {peak:g}; expected floats in [-1, 1]. Divide samples of "
            "16 bits by 32768"
        )
    if of_mix < CANCELLED * of_channels:
        warnings.warn(
            "the channels are of opposite phase and cancel each other; give one of them",
            AudioWarning,
            stacklevel=5,
        )


def _resampled(blocks: Iterator[Audio], source_rate: int, rate: int) -> Iterator[Audio]:
    """Blocks at `rate`; the result does not depend on how the audio is cut."""
    if source_rate == rate:
        yield from blocks
        return
    import soxr

    stream = soxr.ResampleStream(source_rate, rate, 1, dtype="float32", quality="HQ")
    for block in blocks:
        yield stream.resample_chunk(block)
    yield stream.resample_chunk(np.zeros(0, np.float32), last=True)


def _joined(blocks: Iterator[Audio]) -> Audio:
    """One array, which grows in place: beside it no more than a block is held."""
    joined = bytearray()
    for block in blocks:
        joined += block.tobytes()
    return np.frombuffer(joined, np.float32)


def _read(source: str | os.PathLike[str] | BinaryIO, n: int) -> tuple[int, Iterator[AnyArray]]:
    """The rate of a recording, and its samples (up to `n`, n_channels) float32, block by block.

    Raises:
        AudioNotFoundError: no such file.
        UnreadableAudioError: not audio that libsndfile reads; also while blocks are taken.
    """
    import soundfile

    name, opened = _opened(source)
    try:
        sound = _forward(soundfile)(opened)
    except (soundfile.LibsndfileError, RuntimeError, TypeError, ValueError, OSError) as error:
        raise _unreadable(name, error) from error
    return int(sound.samplerate), _blocks(sound, n, name)


def as_float(samples: AnyArray) -> AnyArray:
    """An array (n,) or (n, n_channels) of samples as float32 in [-1, 1].

    Raises:
        UnreadableAudioError: another shape or type, or integers of 16 bits in a wider type.
    """
    shape = samples.shape
    if len(shape) not in (1, 2) or (len(shape) == 2 and shape[1] > MOST_CHANNELS):
        turned = f"; give its transpose ({shape[1]}, {shape[0]})" if len(shape) == 2 else ""
        raise UnreadableAudioError(
            f"audio array has shape {shape}; expected (n,) or (n, n_channels){turned}"
        )
    if samples.dtype in (np.int8, np.int16, np.int32):
        full_scale = -float(np.iinfo(samples.dtype).min)
        peak = int(np.abs(samples.astype(np.int64)).max(initial=0))
        if samples.dtype == np.int32 and 0 < peak < QUIETEST_PEAK:
            raise UnreadableAudioError(
                f"int32 audio array has samples up to {peak}, of a full scale of 2147483648; if "
                "they are samples of 16 bits, give them as int16"
            )
        return (samples / full_scale).astype(np.float32)
    if not np.issubdtype(samples.dtype, np.floating):
        raise UnreadableAudioError(
            f"audio array is {samples.dtype}; expected floats in [-1, 1], int16 or int32. Samples "
            "of 16 bits: array.astype(numpy.int16)"
        )
    return samples.astype(np.float32)


def _opened(source: str | os.PathLike[str] | BinaryIO) -> tuple[str, BinaryIO]:
    """A name for messages, and the open file: libsndfile would not open every name itself."""
    if hasattr(source, "read"):
        return "the audio stream", cast(BinaryIO, source)
    if not isinstance(source, (str, os.PathLike)):
        raise UnreadableAudioError(
            f"got audio of type {type(source).__name__}; expected a file name, an open binary "
            "file, or an array: numpy.asarray(samples, numpy.float32)"
        )
    name, path = os.fspath(source), Path(source)
    shown = os.fsencode(name).decode("utf-8", "backslashreplace")
    try:
        if path.is_dir():
            raise AudioNotFoundError(f"{shown} is a folder, not an audio file")
        if path.exists() and not path.is_file():  # a pipe, which cannot seek
            return shown, io.BytesIO(path.read_bytes())
        return shown, cast(BinaryIO, _Patient(path, "rb"))
    except FileNotFoundError as error:
        if isinstance(error, AudioNotFoundError):
            raise
        raise AudioNotFoundError(f"{shown} does not exist") from error
    except (OSError, ValueError) as error:
        raise AudioNotFoundError(f"{shown} cannot be opened: {one_line(error)}") from error


class _Patient(io.FileIO):
    """A file that stays where it is when a damaged header sends it before its beginning."""

    def seek(self, offset: int, whence: int = 0) -> int:
        try:
            return super().seek(offset, whence)
        except (OSError, OverflowError):
            return self.tell()


def _forward(soundfile: Any) -> Any:  # noqa: ANN401
    """soundfile's class, reading forwards alone: a stated length is never believed."""

    class Forward(soundfile.SoundFile):  # type: ignore[misc]
        def seekable(self) -> bool:
            return False

    return Forward


def _blocks(sound: Any, n: int, name: str) -> Iterator[AnyArray]:  # noqa: ANN401
    import soundfile

    if sound.channels > MOST_CHANNELS:
        raise UnreadableAudioError(f"{name} has {sound.channels} channels; expected 1 to 64")
    with sound:
        while True:
            try:
                block = sound.read(n, dtype="float32", always_2d=True)
            except (soundfile.LibsndfileError, RuntimeError, ValueError) as error:
                raise _unreadable(name, error) from error
            if len(block):
                yield block
            if len(block) < n:
                return


def _unreadable(name: str, error: Exception) -> UnreadableAudioError:
    reason = one_line(getattr(error, "error_string", error))
    return UnreadableAudioError(
        f"{name} is not audio that libsndfile reads ({reason}); convert it to wav, flac, ogg or mp3"
    )
