"""What `bench` measured, for people: tables and a picture."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from facecode.bench.results import BenchReport
from facecode.errors import MissingExtraError
from facecode.loop.part import HEAD_CHUNK
from facecode.writers import writing


def table(report: BenchReport) -> str:
    """The report for people."""
    r = report
    window = "" if r.window is None else f", window {r.window}"
    head = (
        f"{r.system} {r.precision}, {r.mode} mode{window}, {r.audio_s:g} s of speech "
        f"({r.n_frames} frames) after {r.warm_up_s:g} s of warm-up\n"
        f"{r.cpu}, {r.threads} threads, onnxruntime {r.onnxruntime}, {r.provider}, "
        f"Python {r.python}\n"
    )
    rows: list[tuple[str, ...]] = [("ms per frame", "p50", "p95", "p99", "mean")]
    for name, latency in (
        ("frame (loop)", r.frame),
        ("  decoder step", r.decoder_step),
        ("  motion decoder", r.motion_decoder),
    ):
        if latency is not None:
            rows.append((name, *(f"{v:.2f}" for v in dataclasses.astuple(latency))))
    if r.window is None and r.final_decode_ms_per_frame is not None:
        rows.append(("final decode", "", "", "", f"{r.final_decode_ms_per_frame:.2f}"))
    rows.append(
        (f"vertex head ({HEAD_CHUNK} a call)", "", "", "", f"{r.vertex_head_ms_per_frame:.2f}")
    )
    body = "\n".join(f"{row[0]:<24}" + "".join(f"{c:>9}" for c in row[1:]) for row in rows)
    foot = (
        f"speech encoder {r.encoder_s:.2f} s ({1000 * r.encoder_s / r.audio_s:.0f} ms a second); "
        f"total {r.total_s:.2f} s, real-time factor {r.real_time_factor:.3f}\n"
        f"first frame after {r.first_frame_ms:.0f} ms; load {r.load_s:.2f} s; "
        f"peak memory {r.peak_memory_mb:,.0f} MB, in the loop {_memory(r.memory_mb)}"
    )
    return f"{head}\n{body}\n\n{foot}"


def _memory(samples: Sequence[float]) -> str:
    if not samples:
        return "not sampled"
    return f"{samples[0]:,.0f} to {samples[-1]:,.0f} MB"


def comparison(first: BenchReport, second: BenchReport) -> str:
    """Two bundles side by side, and how many times the first takes what the second does."""
    rows = [("", first.bundle, second.bundle, "ratio")]
    for name, a, b in (
        ("frame p50, ms", first.frame.p50_ms, second.frame.p50_ms),
        ("frame p95, ms", first.frame.p95_ms, second.frame.p95_ms),
        ("  decoder step p50", first.decoder_step.p50_ms, second.decoder_step.p50_ms),
        *_motion_decoders(first, second),
        ("vertex head, ms a frame", *_heads(first, second)),
        ("speech encoder, s", first.encoder_s, second.encoder_s),
        ("total, s", first.total_s, second.total_s),
        ("real-time factor", first.real_time_factor, second.real_time_factor),
    ):
        rows.append((name, f"{a:.3f}", f"{b:.3f}", f"{a / b:.2f}"))
    width = max(12, *(len(row[i]) + 2 for row in rows for i in (1, 2)))
    return "\n".join(f"{n:<24}{a:>{width}}{b:>{width}}{r:>8}" for n, a, b, r in rows)


def _motion_decoders(
    first: BenchReport, second: BenchReport
) -> tuple[tuple[str, float, float], ...]:
    """A row, where both bundles have one."""
    if first.motion_decoder is None or second.motion_decoder is None:
        return ()
    return (("  motion decoder p50", first.motion_decoder.p50_ms, second.motion_decoder.p50_ms),)


def _heads(first: BenchReport, second: BenchReport) -> tuple[float, float]:
    return first.vertex_head_ms_per_frame, second.vertex_head_ms_per_frame


def plot(reports: Sequence[BenchReport], path: Path) -> None:
    """Latency against frame index as a PNG.

    Raises:
        MissingExtraError: matplotlib is not installed.
        OutputWriteError
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError.of("--plot", "matplotlib", "plots") from error
    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.add_subplot()
    for r in reports:
        window = "" if r.window is None else f" {r.window}"
        axes.plot(r.frame_ms, linewidth=0.8, label=f"{r.system} {r.precision} {r.mode}{window}")
    axes.set_xlabel("frame")
    axes.set_ylabel("latency in ms")
    axes.set_ylim(bottom=0)
    axes.legend()
    with writing(path) as file:
        figure.savefig(file, format="png", dpi=120)
