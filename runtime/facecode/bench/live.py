"""Streams fed as a microphone feeds them, or as fast as they go: lateness, cost and memory.

The latency of a frame is from its moment of the speech to its weights, with the wait that the
design brings (`Stream.latency_ms`). Streams begin at even distances within a block.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

from facecode.animator import Animator
from facecode.bench.machine import cpu_name, resident_memory_mb
from facecode.bench.measure import looped_speech
from facecode.bench.results import Latency
from facecode.live.stream import Stream
from facecode.session import onnxruntime_version

CHUNK_S = 0.02
MINUTE_S = 60


@dataclass(frozen=True)
class LiveReport:
    """What `facecode bench --live` measures."""

    bundle: str
    precision: str
    cpu: str
    threads: int
    onnxruntime: str
    look_ahead_ms: float
    designed_ms: float
    """What a frame waits for at most, beside computing."""
    n_streams: int
    seconds: float
    """Of speech, each stream."""
    in_real_time: bool
    n_frames: int
    core_share: float
    """Processor time of a stream as a share of its speech: of one core, in real time."""
    first_frame: Latency | None
    """From `face.stream()` to the first frame, the speech that it waits for included; None: fed
    fast, as are the next two."""
    latency: Latency | None
    n_late: int | None
    """Frames that came later than designed by a whole block, so that the next block waited."""
    memory_mb: tuple[float, ...]
    """Resident size of the process after each minute of the first stream's speech."""
    frame_ms: tuple[float, ...]
    """Processor time a frame of each of those minutes, all streams together."""

    def to_plain(self) -> dict[str, Any]:
        """As plain data for JSON."""
        return asdict(self)


@dataclass
class _Fed:
    """What came of one stream."""

    latencies_s: list[float] = field(default_factory=list)
    first_s: float = 0.0
    n_frames: int = 0
    memory_mb: list[float] = field(default_factory=list)
    processor_s: list[float] = field(default_factory=list)
    error: BaseException | None = None


def bench_live(
    face: Animator,
    seconds: float,
    look_ahead_ms: float | None = None,
    n_streams: int = 1,
    in_real_time: bool = True,
) -> LiveReport:
    """Feed `n_streams` at once, each in a thread, with `seconds` of the packaged recording.

    Args:
        face: a loaded bundle.
        seconds: of speech, repeated as often as needed.
        look_ahead_ms: of `Animator.stream`.
        n_streams: how many.
        in_real_time: in pieces of 20 ms, each when it has been spoken; else as fast as they go.

    Raises:
        LookAheadError
    """
    face.stream(look_ahead_ms=look_ahead_ms).feed(looped_speech(face.manifest.sample_rate, 1.0))
    fed = [_Fed() for _ in range(n_streams)]
    plan = face.stream(look_ahead_ms=look_ahead_ms).plan
    block_s = plan.block / plan.fps
    begin = time.perf_counter() + CHUNK_S
    before = time.process_time()
    threads = [
        threading.Thread(
            target=_caught,
            args=(
                one,
                _feeder(
                    face, look_ahead_ms, seconds, begin + block_s * i / n_streams, in_real_time
                ),
            ),
        )
        for i, one in enumerate(fed)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    spent = time.process_time() - before
    for one in fed:
        if one.error is not None:
            raise one.error
    latencies = [s for one in fed for s in one.latencies_s]
    late_s = plan.latency_ms / 1000 + block_s
    minutes = zip(fed[0].processor_s[:-1], fed[0].processor_s[1:], strict=True)
    a_minute = MINUTE_S * plan.fps * n_streams
    return LiveReport(
        bundle=str(face.bundle.root),
        precision=face.manifest.precision,
        cpu=cpu_name(),
        threads=face.compute.n_threads,
        onnxruntime=onnxruntime_version(),
        look_ahead_ms=plan.look_ahead_ms,
        designed_ms=plan.latency_ms,
        n_streams=n_streams,
        seconds=seconds,
        in_real_time=in_real_time,
        n_frames=sum(one.n_frames for one in fed),
        core_share=spent / (seconds * n_streams),
        first_frame=Latency.of(one.first_s for one in fed) if in_real_time else None,
        latency=Latency.of(latencies) if in_real_time else None,
        n_late=sum(s > late_s for s in latencies) if in_real_time else None,
        memory_mb=tuple(fed[0].memory_mb),
        frame_ms=tuple(1000 * (late - early) / a_minute for early, late in minutes),
    )


def _caught(fed: _Fed, feed: Callable[[_Fed], None]) -> None:
    try:
        feed(fed)
    except BaseException as error:
        fed.error = error


def _feeder(
    face: Animator, look_ahead_ms: float | None, seconds: float, begin: float, in_real_time: bool
) -> Callable[[_Fed], None]:
    rate = face.manifest.sample_rate
    speech = looped_speech(rate, min(seconds, MINUTE_S))
    n = round(CHUNK_S * rate)

    def feed(fed: _Fed) -> None:
        _wait_until(begin)
        stream = face.stream(look_ahead_ms=look_ahead_ms)
        fed.processor_s.append(time.process_time())
        for i in range(round(seconds / CHUNK_S)):
            at = i * n % (len(speech) - n + 1)
            if in_real_time:
                _wait_until(begin + (i + 1) * CHUNK_S)
            _take(fed, stream, speech[at : at + n], begin)
            if (i + 1) % round(MINUTE_S / CHUNK_S) == 0:
                fed.memory_mb.append(resident_memory_mb())
                fed.processor_s.append(time.process_time())

    return feed


def _take(fed: _Fed, stream: Stream, chunk: Any, begin: float) -> None:  # noqa: ANN401
    frames = stream.feed(chunk)
    now = time.perf_counter()
    if frames and not fed.n_frames:
        fed.first_s = now - begin
    fed.n_frames += len(frames)
    fed.latencies_s += [now - begin - frame.time_s for frame in frames]


def _wait_until(moment: float) -> None:
    while (left := moment - time.perf_counter()) > 0:
        time.sleep(left)


def live_table(r: LiveReport) -> str:
    """The report for people."""
    how = "in pieces of 20 ms in real time" if r.in_real_time else "as fast as it goes"
    lines = [
        f"{r.bundle} {r.precision}, {r.cpu}, {r.threads} threads, onnxruntime {r.onnxruntime}",
        f"{r.n_streams} streams at once, {r.seconds:g} s of speech each, {how}",
        f"look-ahead {r.look_ahead_ms:.0f} ms, by design {r.designed_ms:.0f} ms and computing",
        f"a stream takes {100 * r.core_share:.1f} % of a core",
    ]
    if r.latency is not None and r.first_frame is not None:
        late = r.latency
        lines += [
            f"speech to weights: p50 {late.p50_ms:.0f} ms, p95 {late.p95_ms:.0f} ms, "
            f"p99 {late.p99_ms:.0f} ms; {r.n_late} of {r.n_frames:,} frames late",
            f"first frame {r.first_frame.p95_ms:.0f} ms after face.stream()",
        ]
    if len(r.memory_mb) > 1:
        lines.append(
            f"memory after the first minute {r.memory_mb[0]:.1f} MB, after the last "
            f"{r.memory_mb[-1]:.1f} MB; a frame {r.frame_ms[0]:.2f} and {r.frame_ms[-1]:.2f} ms"
        )
    return "\n".join(lines)
