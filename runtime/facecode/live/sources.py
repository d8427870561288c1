"""Where live speech comes from: a microphone, or raw samples out of a pipe."""

from __future__ import annotations

import queue
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np

from facecode.arrays import AnyArray
from facecode.errors import MicrophoneError, MissingExtraError

PIPE_BYTES = 1 << 14
MICROPHONE_CHUNK_S = 0.02
MOST_WAITING = 3000
"""Chunks of a microphone that are held at most: a minute."""
DTYPES: dict[str, np.dtype[Any]] = {"s16": np.dtype("<i2"), "f32": np.dtype("<f4")}


def pipe_chunks(pipe: BinaryIO, dtype: str, channels: int) -> Iterator[AnyArray]:
    """Samples (n, channels) of an open pipe as they arrive, until it ends.

    Args:
        pipe: little-endian samples, channels interleaved; a last one that is cut off is dropped.
        dtype: `s16` or `f32`.
        channels: in the pipe.
    """
    width, rest = DTYPES[dtype].itemsize * channels, b""
    read = getattr(pipe, "read1", pipe.read)
    while data := read(PIPE_BYTES):
        data = rest + data
        whole = len(data) // width * width
        rest = data[whole:]
        if whole:
            yield np.frombuffer(data[:whole], DTYPES[dtype]).reshape(-1, channels)


@contextmanager
def microphone_chunks(
    sample_rate: int, device: str | None = None
) -> Iterator[Iterator[tuple[AnyArray, float]]]:
    """Open a microphone: chunks of 20 ms (n, 1) float32, each with the seconds that wait behind it.

    Args:
        sample_rate: in Hz.
        device: its number or a part of its name; the system's choice by default.

    Raises:
        MissingExtraError: sounddevice, or its PortAudio, is not installed.
        MicrophoneError: no such device, or it cannot be opened; also while chunks are taken, when
            the device vanishes.
    """
    try:
        import sounddevice
    except (ImportError, OSError) as error:
        raise MissingExtraError.of("a microphone", "sounddevice and PortAudio", "live") from error
    waiting: queue.Queue[AnyArray | None] = queue.Queue(MOST_WAITING)

    def heard(samples: AnyArray, *_: object) -> None:
        try:
            waiting.put_nowait(samples.copy())
        except queue.Full:
            ended()

    def ended() -> None:
        with waiting.mutex:
            waiting.queue.append(None)
            waiting.not_empty.notify()

    try:
        microphone = sounddevice.InputStream(
            samplerate=sample_rate,
            blocksize=round(MICROPHONE_CHUNK_S * sample_rate),
            device=int(device) if device is not None and device.isdecimal() else device,
            channels=1,
            dtype="float32",
            callback=heard,
            finished_callback=ended,
        )
        microphone.start()
    except (sounddevice.PortAudioError, ValueError) as error:
        raise MicrophoneError(
            f"the microphone cannot be opened ({error}); 'python -m sounddevice' lists devices, "
            "--device picks one"
        ) from error
    try:
        yield _until_it_ends(waiting)
    finally:
        microphone.close()


def _until_it_ends(waiting: queue.Queue[AnyArray | None]) -> Iterator[tuple[AnyArray, float]]:
    while (chunk := waiting.get()) is not None:
        yield chunk, waiting.qsize() * MICROPHONE_CHUNK_S
    raise MicrophoneError("the microphone has stopped; check that it is still plugged in")
