"""Per-frame latency of a bundle on this CPU, graph by graph.

One warm-up second, then one clip of real speech, timed around each graph call. Latency does not
depend on the weights, nor on what is said.
"""

from __future__ import annotations

import dataclasses
import platform
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facecode.animator import Animator, Request
from facecode.arrays import AnyArray, Audio, Float32
from facecode.audio import SPEECH, load_audio
from facecode.part import HEAD_CHUNK
from facecode.session import ONNXRUNTIME_VERSION, Graph

WARM_UP_S = 1.0


class TimedGraph(Graph):
    """A graph that notes how long each call took."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self.name = graph.name
        self.seconds: list[float] = []

    def run(self, outputs: Sequence[str], **inputs: AnyArray) -> list[AnyArray]:
        """As `Graph.run`."""
        start = time.perf_counter()
        result = self._graph.run(outputs, **inputs)
        self.seconds.append(time.perf_counter() - start)
        return result


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
    motion_decoder: Latency
    final_decode_ms_per_frame: float
    vertex_head_ms_per_frame: float
    total_s: float
    real_time_factor: float
    """Time to animate divided by the duration of the audio: below 1 is faster than real time."""
    first_frame_ms: float
    """From the waveform to the vertices of frame 0, encoder included."""
    peak_memory_mb: float

    def to_plain(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return dataclasses.asdict(self)


def benchmark(animator: Animator, load_s: float, seconds: float, window: int | None) -> BenchReport:
    """Time one clip of `seconds`; `window` as in `Animator.generate`."""
    m = animator.manifest
    speech = looped_speech(m.sample_rate, seconds)
    weights = np.eye(1, len(m.styles), dtype=np.float32)[0]
    _run(animator, speech[: int(WARM_UP_S * m.sample_rate)], weights, window)
    timed = _timed(animator)
    run = _run(timed, speech, weights, window)
    n_frames = len(run.frame_s)
    step_s = _summed([p.decoder_step for p in timed.parts])
    motion_s = _summed([p.motion.graph for p in timed.parts])
    head_s = [s for p in timed.parts for s in _seconds(p.vertex_head)]
    return BenchReport(
        bundle=str(animator.bundle.root),
        system=m.name,
        precision=m.precision,
        mode="exact" if window is None else "window",
        window=window,
        cpu=cpu_name(),
        threads=animator.threads,
        onnxruntime=ONNXRUNTIME_VERSION,
        python=platform.python_version(),
        audio_s=len(speech) / m.sample_rate,
        n_frames=n_frames,
        warm_up_s=WARM_UP_S,
        load_s=load_s,
        encoder_s=run.encoder_s,
        frame=Latency.of(run.frame_s),
        decoder_step=Latency.of(step_s),
        motion_decoder=Latency.of(motion_s[:-1] or [0.0]),
        final_decode_ms_per_frame=1000 * motion_s[-1] / n_frames,
        vertex_head_ms_per_frame=1000 * sum(head_s) / n_frames,
        total_s=run.total_s,
        real_time_factor=run.total_s * m.sample_rate / len(speech),
        first_frame_ms=1000 * _first_frame(animator, speech, weights),
        peak_memory_mb=peak_memory_mb(),
    )


def looped_speech(rate: int, seconds: float) -> Audio:
    """The packaged recording, repeated and cut to `seconds`."""
    speech = load_audio(SPEECH, rate)
    return np.resize(speech, max(1, round(seconds * rate)))


@dataclass(frozen=True)
class _Run:
    encoder_s: float
    frame_s: list[float]
    total_s: float


def _run(animator: Animator, speech: Audio, weights: Float32, window: int | None) -> _Run:
    start = time.perf_counter()
    memory = animator.encode(speech)
    encoded = previous = time.perf_counter()
    frames, codes = [], []
    for code in animator.generate([memory], weights[None], Request(window)):
        now = time.perf_counter()
        frames.append(now - previous)
        codes.append(np.concatenate(code, axis=-1))
        previous = now
    animator.decode(np.concatenate(codes, axis=1))
    return _Run(encoded - start, frames, time.perf_counter() - start)


def _first_frame(animator: Animator, speech: Audio, weights: Float32) -> float:
    start = time.perf_counter()
    frames = animator.generate([animator.encode(speech)], weights[None], Request())
    animator.decode(np.concatenate(next(iter(frames)), axis=-1))
    return time.perf_counter() - start


def _timed(animator: Animator) -> Animator:
    """The same animator with its parts' graphs timed."""
    copy = object.__new__(Animator)
    copy.__dict__.update(animator.__dict__)
    copy.parts = tuple(
        dataclasses.replace(
            part,
            decoder_step=TimedGraph(part.decoder_step),
            motion=dataclasses.replace(part.motion, graph=TimedGraph(part.motion.graph)),
            vertex_head=TimedGraph(part.vertex_head),
        )
        for part in animator.parts
    )
    return copy


def _summed(graphs: Sequence[Graph]) -> list[float]:
    """Seconds of the n-th call of each graph, added up."""
    return [sum(calls) for calls in zip(*map(_seconds, graphs), strict=True)]


def _seconds(graph: Graph) -> list[float]:
    assert isinstance(graph, TimedGraph)
    return graph.seconds


def table(report: BenchReport) -> str:
    """The report for people."""
    r = report
    window = "" if r.window is None else f", window {r.window}"
    head = (
        f"{r.system} {r.precision}, {r.mode} mode{window}, {r.audio_s:g} s of speech "
        f"({r.n_frames} frames) after {r.warm_up_s:g} s of warm-up\n"
        f"{r.cpu}, {r.threads} threads, onnxruntime {r.onnxruntime}, Python {r.python}\n"
    )
    rows: list[tuple[str, ...]] = [("ms per frame", "p50", "p95", "p99", "mean")]
    for name, latency in (
        ("frame (loop)", r.frame),
        ("  decoder step", r.decoder_step),
        ("  motion decoder", r.motion_decoder),
    ):
        rows.append((name, *(f"{v:.2f}" for v in dataclasses.astuple(latency))))
    rows.append(("final decode", "", "", "", f"{r.final_decode_ms_per_frame:.2f}"))
    rows.append(
        (f"vertex head ({HEAD_CHUNK} a call)", "", "", "", f"{r.vertex_head_ms_per_frame:.2f}")
    )
    body = "\n".join(f"{row[0]:<24}" + "".join(f"{c:>9}" for c in row[1:]) for row in rows)
    foot = (
        f"speech encoder {r.encoder_s:.2f} s ({1000 * r.encoder_s / r.audio_s:.0f} ms a second); "
        f"total {r.total_s:.2f} s, real-time factor {r.real_time_factor:.3f}\n"
        f"first frame after {r.first_frame_ms:.0f} ms; load {r.load_s:.2f} s; "
        f"peak memory {r.peak_memory_mb:,.0f} MB"
    )
    return f"{head}\n{body}\n\n{foot}"


def cpu_name() -> str:
    """The processor's name, as well as the system tells it."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def peak_memory_mb() -> float:
    """The largest resident size of this process so far, in 10^6 bytes."""
    try:
        import resource
    except ImportError:  # Windows
        return float("nan")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
