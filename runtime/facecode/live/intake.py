"""Chunks of speech of any kind to the waveform that the encoder hears."""

from __future__ import annotations

import numpy as np

from facecode.arrays import AnyArray, Audio
from facecode.audio import LOUDEST, as_float
from facecode.errors import NonFiniteAudioError, StreamRateError, UnreadableAudioError

HIGHEST_RATE = 768_000


class Intake:
    """Resamples chunks as they come; what comes out does not depend on how they were cut."""

    def __init__(self, rate: int) -> None:
        """Deliver at `rate` Hz."""
        self._rate = rate
        self._source_rate: int | None = None
        self._begin()

    def _begin(self) -> None:
        import soxr

        self._resampler = None
        if self._source_rate not in (None, self._rate):
            self._resampler = soxr.ResampleStream(
                self._source_rate, self._rate, 1, dtype="float32", quality="HQ"
            )

    def take(self, samples: AnyArray, rate: int | None) -> Audio:
        """A chunk (n,) or (n, n_channels) as mono float32 at the rate to deliver.

        Args:
            samples: floats in [-1, 1], or signed integers.
            rate: of the samples in Hz, the same for all chunks; by default that of the chunk
                before, and of the first one the rate to deliver.

        Raises:
            NonFiniteAudioError: NaN or infinite samples; the chunk is not taken.
            UnreadableAudioError: another type or shape, or floats that are no samples.
            StreamRateError: no rate, or another than before.
        """
        mono = _mono(samples)
        rate = rate or self._source_rate or self._rate
        if self._source_rate is None:
            if not 1000 <= rate <= HIGHEST_RATE:
                raise StreamRateError(f"got {rate} samples a second; expected 1000 to 768000")
            self._source_rate = rate
            self._begin()
        if rate != self._source_rate:
            raise StreamRateError(
                f"got samples at {rate} Hz after samples at {self._source_rate} Hz; one stream has "
                "one rate: call reset(), or open another stream"
            )
        return mono if self._resampler is None else self._resampler.resample_chunk(mono)

    def drain(self) -> Audio:
        """What the resampler still holds; the next chunk begins anew."""
        if self._resampler is None:
            return np.zeros(0, np.float32)
        rest: Audio = self._resampler.resample_chunk(np.zeros(0, np.float32), last=True)
        self._begin()
        return rest


def _mono(samples: AnyArray) -> Audio:
    block = as_float(np.asarray(samples))
    if not np.isfinite(block).all():
        raise NonFiniteAudioError(
            f"{block.size - int(np.isfinite(block).sum())} of {block.size} samples of the chunk "
            "are NaN or infinite; leave the chunk out, or give silence in its place"
        )
    if np.abs(block).max(initial=0) > LOUDEST:
        raise UnreadableAudioError(
            f"the chunk has samples up to {np.abs(block).max():g}; expected floats in [-1, 1]. "
            "Divide samples of 16 bits by 32768, or give them as int16"
        )
    mono = block if block.ndim == 1 else block.mean(axis=1, dtype=np.float32)
    return np.ascontiguousarray(mono, dtype=np.float32)
