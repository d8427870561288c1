"""The public algorithm in PyTorch timed beside the runtime: same audio, same threads, one run.

The public code runs the whole prefix again at every step, so that a long clip takes minutes. Its
steps are therefore timed at a few prefix lengths and summed over the straight lines between; for
the shortest clip the sum is checked against a full run. Rounds take turns, since the speed of a
shared machine drifts; a time is the median of its rounds.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import torch

from facecode.animator import Animator
from facecode.arrays import Audio
from facecode.bench.machine import cpu_name
from facecode.bench.measure import looped_speech
from facecode.loop.request import Window
from facecode.options import Mode
from facecode.session import onnxruntime_version
from facecode_exporter.bench_reference.public_algorithm import PublicAlgorithm
from facecode_exporter.nets.networks import Network

N_PREFIXES = 9
WARM_UP_S = 1.0
PAUSE_S = 0.1
"""Between two turns: threads of the other side that still spin go to sleep."""


@dataclass(frozen=True)
class ReferenceTime:
    """What the public algorithm takes for one clip length."""

    seconds: float
    n_frames: int
    encoder_ms_per_frame: float
    ms_per_frame: float
    """Encoder included, from the steps at `prefixes`."""
    prefixes: tuple[int, ...]
    step_ms: tuple[float, ...]
    """Median of one step at each of `prefixes`."""
    full_run_ms_per_frame: float | None = None
    """Measured from end to end, for the shortest clip."""


@dataclass(frozen=True)
class RuntimeTime:
    """What the runtime takes for one clip length, bundle and mode."""

    seconds: float
    bundle: str
    system: str
    precision: str
    mode: str
    window: int | None
    ms_per_frame: float
    """Encoder, loop and vertices of all frames."""
    ratio: float
    """Times faster than the reference."""
    real_time_factor: float


@dataclass(frozen=True)
class Comparison:
    """One run of `bench-reference`."""

    cpu: str
    threads: int
    rounds: int
    torch: str
    onnxruntime: str
    reference: tuple[ReferenceTime, ...]
    runtime: tuple[RuntimeTime, ...]

    def to_plain(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return dataclasses.asdict(self)


@dataclass(frozen=True)
class Contestant:
    """A bundle in one mode."""

    animator: Animator
    mode: Mode
    window: Window | None
    """None in `exact` mode."""

    def run(self, speech: Audio) -> None:
        """Animate `speech` in the first style, vertices included."""
        engine = self.animator.engine
        engine.animate(speech, engine.request(window=self.window))


def compare(
    net: Network,
    contestants: Sequence[Contestant],
    lengths_s: Sequence[float],
    rounds: int,
    threads: int,
    progress: Callable[[str], None] = lambda _: None,
) -> Comparison:
    """Time every contestant and the public algorithm at every clip length, in turns."""
    torch.set_num_threads(threads)
    rate = net.system.speech_encoder.sample_rate
    for contestant in contestants:
        contestant.run(looped_speech(rate, WARM_UP_S))
    reference: list[ReferenceTime] = []
    runtime: list[RuntimeTime] = []
    for seconds in sorted(lengths_s):
        progress(f"{seconds:g} s")
        speech = looped_speech(rate, seconds)
        truth, ours = _one_length(net, contestants, speech, rounds, full=not reference)
        reference.append(truth)
        runtime += [_entry(c, truth, t) for c, t in zip(contestants, ours, strict=True)]
    return Comparison(
        cpu=cpu_name(),
        threads=threads,
        rounds=rounds,
        torch=torch.__version__,
        onnxruntime=onnxruntime_version(),
        reference=tuple(reference),
        runtime=tuple(runtime),
    )


def _one_length(
    net: Network, contestants: Sequence[Contestant], speech: Audio, rounds: int, full: bool
) -> tuple[ReferenceTime, list[float]]:
    """The reference, and seconds of every contestant, for one clip."""
    public = PublicAlgorithm(net, speech)
    prefixes = sorted({int(n) for n in np.linspace(1, public.n_frames, N_PREFIXES)})
    encoder, whole = [], []
    steps: list[list[float]] = [[] for _ in prefixes]
    ours: list[list[float]] = [[] for _ in contestants]
    for _ in range(rounds):
        encoder.append(_seconds(public.encode))
        for n, times in zip(prefixes, steps, strict=True):
            times.append(_seconds(partial(public.step, n)))
        if full:
            whole.append(_seconds(public.run))
        for contestant, times in zip(contestants, ours, strict=True):
            times.append(_seconds(partial(contestant.run, speech)))
    step_s, encoder_s = [float(np.median(t)) for t in steps], float(np.median(encoder))
    every = np.interp(np.arange(1, public.n_frames + 1), prefixes, step_s)
    truth = ReferenceTime(
        seconds=len(speech) / net.system.speech_encoder.sample_rate,
        n_frames=public.n_frames,
        encoder_ms_per_frame=1000 * encoder_s / public.n_frames,
        ms_per_frame=1000 * (encoder_s + float(every.sum())) / public.n_frames,
        prefixes=tuple(prefixes),
        step_ms=tuple(1000 * s for s in step_s),
        full_run_ms_per_frame=1000 * float(np.median(whole)) / public.n_frames if full else None,
    )
    return truth, [float(np.median(t)) for t in ours]


def _seconds(action: Callable[[], object]) -> float:
    time.sleep(PAUSE_S)
    start = time.perf_counter()
    action()
    return time.perf_counter() - start


def _entry(contestant: Contestant, truth: ReferenceTime, seconds: float) -> RuntimeTime:
    manifest = contestant.animator.manifest
    ms = 1000 * seconds / truth.n_frames
    return RuntimeTime(
        seconds=truth.seconds,
        bundle=str(contestant.animator.bundle.root),
        system=manifest.name,
        precision=manifest.precision,
        mode=contestant.mode,
        window=None if contestant.window is None else contestant.window.frames,
        ms_per_frame=ms,
        ratio=truth.ms_per_frame / ms,
        real_time_factor=seconds / truth.seconds,
    )
