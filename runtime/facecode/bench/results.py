"""What `facecode bench` measures, as values."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Latency:
    """Milliseconds per frame: percentiles and mean."""

    p50_ms: float
    p95_ms: float
    p99_ms: float
    mean_ms: float

    @classmethod
    def of(cls, seconds: Iterable[float]) -> Latency:
        """Summarise durations in seconds."""
        ms = 1000 * np.array(list(seconds))
        p50, p95, p99 = (float(p) for p in np.percentile(ms, (50, 95, 99)))
        return cls(p50, p95, p99, float(ms.mean()))


@dataclass(frozen=True)
class BenchReport:
    """What `facecode bench` measures; times of one clip after a warm-up."""

    bundle: str
    system: str
    precision: str
    mode: str
    window: int | None
    cpu: str
    threads: int
    provider: str
    onnxruntime: str
    python: str
    audio_s: float
    n_frames: int
    warm_up_s: float
    load_s: float
    encoder_s: float
    frame: Latency
    """Decoder step, look-up and motion decode: what the loop costs per frame."""
    decoder_step: Latency
    motion_decoder: Latency | None
    """None: a system without codes."""
    final_decode_ms_per_frame: float | None
    """None: a system without codes."""
    vertex_head_ms_per_frame: float
    total_s: float
    real_time_factor: float
    """Time to animate divided by the duration of the audio: below 1 is faster than real time."""
    first_frame_ms: float
    """From the waveform to the vertices of frame 0, encoder included."""
    peak_memory_mb: float
    memory_mb: tuple[float, ...]
    """Resident size of the process over the loop, at even distances."""
    frame_ms: tuple[float, ...]
    """Latency of every frame."""

    def to_plain(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return dataclasses.asdict(self)
