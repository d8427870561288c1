"""Per-frame latency of a bundle on this CPU, graph by graph.

One warm-up second, then one clip of real speech, timed around each graph call. Latency does not
depend on the weights, nor on what is said.
"""

from __future__ import annotations

import dataclasses
import platform
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.animator import Animator
from facecode.arrays import AnyArray, Audio
from facecode.audio import SPEECH, load_audio
from facecode.bench.machine import cpu_name, peak_memory_mb, resident_memory_mb
from facecode.bench.results import BenchReport, Latency
from facecode.loop.engine import Engine, Faces, blocks
from facecode.loop.part import MotionDecoder
from facecode.loop.request import Request, Window
from facecode.loop.step import Frame
from facecode.session import Graph, onnxruntime_version

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


def benchmark(
    animator: Animator, load_s: float, seconds: float, window: Window | None
) -> BenchReport:
    """Time one clip of `seconds`; `window` None for `exact`."""
    m, engine = animator.manifest, animator.engine
    speech = looped_speech(m.sample_rate, seconds)
    request = engine.request(window=window)
    _run(engine, speech[: int(WARM_UP_S * m.sample_rate)], request)
    timed = _timed(engine)
    run = _run(timed, speech, request)
    n_frames = len(run.frame_s)
    step_s = _summed([p.decoder_step for p in timed.parts])
    motion_s = _summed([p.motion.graph for p in timed.parts if p.motion is not None])
    head_s = [s for p in timed.parts for s in _seconds(p.vertex_head)]
    return BenchReport(
        bundle=str(animator.bundle.root),
        system=m.name,
        precision=m.precision,
        mode="exact" if window is None else "window",
        window=None if window is None else window.frames,
        cpu=cpu_name(),
        threads=animator.compute.n_threads,
        provider=animator.compute.provider,
        onnxruntime=onnxruntime_version(),
        python=platform.python_version(),
        audio_s=len(speech) / m.sample_rate,
        n_frames=n_frames,
        warm_up_s=WARM_UP_S,
        load_s=load_s,
        encoder_s=sum(_seconds(timed.speech_encoder.graph)),
        frame=Latency.of(run.frame_s),
        decoder_step=Latency.of(step_s),
        motion_decoder=Latency.of(motion_s[:-1] or [0.0]) if motion_s else None,
        final_decode_ms_per_frame=1000 * motion_s[-1] / n_frames if motion_s else None,
        vertex_head_ms_per_frame=1000 * sum(head_s) / n_frames,
        total_s=run.total_s,
        real_time_factor=run.total_s * m.sample_rate / len(speech),
        first_frame_ms=1000 * _first_frame(engine, speech),
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


def _run(engine: Engine, speech: Audio, request: Request) -> _Run:
    """One clip; in `window` mode vertices are made as frames become final, and dropped."""
    start = time.perf_counter()
    memory = engine.encode(speech)
    seconds: list[float] = []
    resident: list[float] = []
    every = max(1, memory.n_frames // MEMORY_SAMPLES)

    def timed() -> Iterator[Frame]:
        previous = time.perf_counter()
        for frame in engine.frames([memory], request):
            if frame.codes:
                seconds.append(time.perf_counter() - previous)
                if len(seconds) % every == 0:
                    resident.append(resident_memory_mb())
            yield frame
            previous = time.perf_counter()

    faces = Faces(engine.parts, engine.n_vertices, n_clips=1)
    for _ in blocks(faces, timed()):
        pass
    return _Run(seconds, time.perf_counter() - start, tuple(resident))


def _first_frame(engine: Engine, speech: Audio) -> float:
    start = time.perf_counter()
    faces = Faces(engine.parts, engine.n_vertices)
    faces.add(next(engine.frames([engine.encode(speech)], engine.request())))
    faces.finish()
    faces.take()
    return time.perf_counter() - start


def _timed(engine: Engine) -> Engine:
    """The same engine with its graphs timed."""
    encoder = engine.speech_encoder
    return dataclasses.replace(
        engine,
        speech_encoder=encoder.with_graph(TimedGraph(encoder.graph)),
        parts=tuple(
            dataclasses.replace(
                part,
                decoder_step=TimedGraph(part.decoder_step),
                motion=_timed_motion(part.motion),
                vertex_head=TimedGraph(part.vertex_head),
            )
            for part in engine.parts
        ),
    )


def _timed_motion(motion: MotionDecoder | None) -> MotionDecoder | None:
    return motion and dataclasses.replace(motion, graph=TimedGraph(motion.graph))


def _summed(graphs: Sequence[Graph]) -> list[float]:
    """Seconds of the n-th call of each graph, added up."""
    return [sum(calls) for calls in zip(*map(_seconds, graphs), strict=True)]


def _seconds(graph: Graph) -> list[float]:
    assert isinstance(graph, TimedGraph)
    return graph.seconds


def compare(
    animators: Sequence[Animator], seconds: float, mode: str, window: int | None
) -> list[BenchReport]:
    """Interleave ROUNDS runs of each bundle; keep the median by total time."""
    runs: list[list[BenchReport]] = [[] for _ in animators]
    for _ in range(ROUNDS):
        for animator, reports in zip(animators, runs, strict=True):
            how = animator.window(mode, window)
            reports.append(benchmark(animator, float("nan"), seconds, how))
    return [sorted(reports, key=lambda r: r.total_s)[ROUNDS // 2] for reports in runs]
