"""A comparison as a table for people."""

from __future__ import annotations

from collections.abc import Iterator

from facecode_exporter.bench_reference.compare import N_PREFIXES, Comparison


def table(result: Comparison) -> str:
    """The comparison for people."""
    return "\n".join(_lines(result))


def _lines(result: Comparison) -> Iterator[str]:
    yield (
        f"{result.cpu}, {result.threads} threads, torch {result.torch}, onnxruntime "
        f"{result.onnxruntime}; medians of {result.rounds} rounds in turns"
    )
    yield "ms per frame, speech encoder and vertices included:"
    yield f"{'audio':>7}{'frames':>8}  {'who':<34}{'ms/frame':>10}{'ratio':>8}{'real time':>11}"
    for truth in result.reference:
        head = f"{truth.seconds:>5g} s{truth.n_frames:>8}  "
        factor = truth.ms_per_frame * truth.n_frames / 1000 / truth.seconds
        yield f"{head}{'public algorithm':<34}{truth.ms_per_frame:>10.1f}{1:>8}{factor:>11.2f}"
        for r in (r for r in result.runtime if r.seconds == truth.seconds):
            window = "" if r.window is None else f" {r.window}"
            who = f"{r.system} {r.precision} {r.mode}{window}"
            numbers = f"{r.ms_per_frame:>10.2f}{r.ratio:>8.1f}{r.real_time_factor:>11.3f}"
            yield f"{head}{who:<34}{numbers}"
    first = result.reference[0]
    assert first.full_run_ms_per_frame is not None
    yield (
        f"public algorithm: summed from steps at {N_PREFIXES} prefix lengths; a full run of "
        f"{first.seconds:g} s takes {first.full_run_ms_per_frame:.1f} ms per frame, the sum says "
        f"{first.ms_per_frame:.1f}"
    )
