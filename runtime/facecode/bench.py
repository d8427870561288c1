"""Per-frame latency of a bundle on this CPU, graph by graph.

One warm-up second, then one clip of real speech, timed around each graph call. Latency does not
depend on the weights, nor on what is said.
"""

from __future__ import annotations

import dataclasses
import os
import platform
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facecode.animator import Animator
from facecode.arrays import AnyArray, Audio, Float32
from facecode.audio import SPEECH, load_audio
from facecode.part import HEAD_CHUNK
from facecode.request import Request
from facecode.session import ONNXRUNTIME_VERSION, Graph
from facecode.shown import ShownFrames
from facecode.speech import SpeechEncoder

WARM_UP_S = 1.0
ROUNDS = 3
MEMORY_SAMPLES = 50


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
    memory_mb: tuple[float, ...]
    """Resident size of the process over the loop, at even distances."""
    frame_ms: tuple[float, ...]
    """Latency of every frame."""

    def to_plain(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return dataclasses.asdict(self)


def benchmark(animator: Animator, load_s: float, seconds: float, window: int | None) -> BenchReport:
    """Time one clip of `seconds`; `window` as in `Request`."""
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
        encoder_s=sum(_seconds(timed.speech_encoder.graph)),
        frame=Latency.of(run.frame_s),
        decoder_step=Latency.of(step_s),
        motion_decoder=Latency.of(motion_s[:-1] or [0.0]),
        final_decode_ms_per_frame=1000 * motion_s[-1] / n_frames,
        vertex_head_ms_per_frame=1000 * sum(head_s) / n_frames,
        total_s=run.total_s,
        real_time_factor=run.total_s * m.sample_rate / len(speech),
        first_frame_ms=1000 * _first_frame(animator, speech, weights),
        peak_memory_mb=peak_memory_mb(),
        memory_mb=run.memory_mb,
        frame_ms=tuple(1000 * s for s in run.frame_s),
    )


def looped_speech(rate: int, seconds: float) -> Audio:
    """The packaged recording, repeated and cut to `seconds`."""
    speech = load_audio(SPEECH, rate)
    return np.resize(speech, max(1, round(seconds * rate)))


@dataclass(frozen=True)
class _Run:
    frame_s: list[float]
    total_s: float
    memory_mb: tuple[float, ...]


def _run(animator: Animator, speech: Audio, weights: Float32, window: int | None) -> _Run:
    """One clip; in `window` mode vertices are made as frames become final, and dropped."""
    start = time.perf_counter()
    memory = animator.encode(speech)
    previous = time.perf_counter()
    every = max(1, memory.n_frames // MEMORY_SAMPLES)
    frames, codes, resident = [], [], []
    shows = [ShownFrames() for _ in animator.parts]
    for code in animator.generate([memory], weights[None], Request(window), shows):
        now = time.perf_counter()
        frames.append(now - previous)
        if window is None:
            codes.append(np.concatenate(code, axis=-1))
        elif len(shows[0]) >= HEAD_CHUNK:
            _drop(animator, shows)
        if len(frames) % every == 0:
            resident.append(resident_memory_mb())
        previous = time.perf_counter()
    if window is None:
        animator.decode(np.concatenate(codes, axis=1))
    else:
        _drop(animator, shows)
    return _Run(frames, time.perf_counter() - start, tuple(resident))


def _drop(animator: Animator, shows: Sequence[ShownFrames]) -> None:
    """Vertices of the waiting frames, looked at by nobody."""
    for part, show in zip(animator.parts, shows, strict=True):
        hidden = show.take(0, 1)
        size = (*hidden.shape[:2], animator.manifest.n_vertices, 3)
        part.show(hidden, np.empty(size, np.float32))


def _first_frame(animator: Animator, speech: Audio, weights: Float32) -> float:
    start = time.perf_counter()
    frames = animator.generate([animator.encode(speech)], weights[None], Request())
    animator.decode(np.concatenate(next(iter(frames)), axis=-1))
    return time.perf_counter() - start


def _timed(animator: Animator) -> Animator:
    """The same animator with its parts' graphs timed."""
    copy = object.__new__(Animator)
    copy.__dict__.update(animator.__dict__)
    encoder = TimedGraph(animator.speech_encoder.graph)
    copy.speech_encoder = SpeechEncoder(encoder, animator.manifest)
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


def resident_memory_mb() -> float:
    """The resident size of this process now, in 10^6 bytes; not a number where it is unknown."""
    statm = Path("/proc/self/statm")
    if not statm.is_file():
        return float("nan")
    return int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def compare(
    animators: Sequence[Animator], seconds: float, mode: str, window: int | None
) -> list[BenchReport]:
    """Time several bundles in turns; of each the run with the median total of ROUNDS."""
    runs: list[list[BenchReport]] = [[] for _ in animators]
    for _ in range(ROUNDS):
        for animator, reports in zip(animators, runs, strict=True):
            frames = animator.window_frames(mode, window)
            reports.append(benchmark(animator, float("nan"), seconds, frames))
    return [sorted(reports, key=lambda r: r.total_s)[ROUNDS // 2] for reports in runs]
