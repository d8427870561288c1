"""What a bundle is, for people and as plain data."""

from __future__ import annotations

from typing import Any

from facecode.bundle import Bundle
from facecode.live.plan import Plan, is_causal
from facecode.session import available_providers
from facecode_spec.live import LiveDeviation, LiveMeasure
from facecode_spec.manifest import Manifest, ModeEntry
from facecode_spec.plain import to_plain


def describe(bundle: Bundle) -> dict[str, Any]:
    """The manifest as plain data, with the total size in bytes."""
    plain: dict[str, Any] = to_plain(bundle.manifest)
    plain["total_size"] = sum(f.size for f in bundle.manifest.files.values())
    return plain


def summary(bundle: Bundle) -> str:
    """The bundle in a few lines."""
    m = bundle.manifest
    sizes = {name: entry.size for name, entry in m.files.items()}
    template = "of the export" if m.has_template else "none: vertices are offsets from zero"
    lines = [
        ("bundle", f"{bundle.root} (format {m.format_version})"),
        ("system", f"{m.name}: {m.reference}"),
        ("motion", f"{m.n_vertices:,} vertices at {m.fps:g} fps, unit {m.unit}"),
        ("parts", ", ".join(f"{p.name} ({_count(p.n_samples)}, {p.kind})" for p in m.parts)),
        *(
            ()
            if m.family == "faceformer"
            else (("", "for --hold PART=talk.npz, --samples PART=K"),)
        ),
        ("audio", f"{m.sample_rate:,} Hz mono"),
        *(("mode", f"{name}: {_mode(entry)}") for name, entry in m.modes.items()),
        *_streams(m),
        ("styles", f"{', '.join(m.styles)} (--style)"),
        *((("identities", f"{', '.join(m.identities)} (--template)"),) if m.identities else ()),
        *((("regions", ", ".join(m.regions)),) if m.regions else ()),
        ("template", f"{template}; faces {'yes' if m.faces else 'no'}"),
        ("rig", "none" if m.rig is None else f"{len(m.rig.names)} face units"),
        ("precision", f"{m.precision}, opset {m.opset}"),
        ("parity", _parity(bundle)),
        ("verified", f"{len(sizes)} files, {_megabytes(sum(sizes.values()))}"),
        *((f"  {graph.path}", _megabytes(sizes[graph.path])) for graph in m.graphs),
        ("licence", m.licence),
        ("providers", ", ".join(available_providers())),
    ]
    width = max(len(name) for name, _ in lines)
    return "\n".join(f"{name:<{width}}  {value}" for name, value in lines)


def _parity(bundle: Bundle) -> str:
    report = bundle.manifest.parity
    if report is None:
        return "not measured"
    codes = sum(c.n_codes for c in report.cases)
    equal = sum(c.n_codes_equal for c in report.cases)
    worst = max(c.max_vertex_error for c in report.cases)
    frames = ", ".join(str(c.n_frames) for c in report.cases)
    equality = f"{equal} of {codes} codes equal to torch, vertices" if codes else "to torch"
    return f"{equality} within {worst:.1e}, clips of {frames} frames"


def _mode(entry: ModeEntry) -> str:
    ahead = "the whole clip" if entry.look_ahead_ms is None else f"{entry.look_ahead_ms:g} ms"
    if entry.delay_frames is None:
        return f"look-ahead {ahead}"
    final = f"{entry.delay_frames} later" if entry.delay_frames else "at once"
    return f"look-ahead {ahead}, frames final {final}"


def _streams(m: Manifest) -> list[tuple[str, str]]:
    """How the bundle is streamed, and what was measured of it."""
    if "window" not in m.modes and not is_causal(m.modes):
        return []
    plan = Plan.of(m)
    hears = (
        f"look-ahead {plan.look_ahead_ms:.0f} ms, latency {plan.latency_ms:.0f} ms and computing; "
        f"blocks of {1000 * plan.block / plan.fps:.0f} ms after {plan.context / plan.fps:.1f} s"
    )
    measured = None if m.live is None else m.live.measured
    rows = [] if measured is None else [_deviation(x, measured) for x in measured.look_aheads]
    return [("stream", hears), *(("", row) for row in rows)]


def _deviation(each: LiveDeviation, measured: LiveMeasure) -> str:
    r = "unknown" if each.opening_r is None else f"{each.opening_r:.3f}"
    ratio = each.acceleration_ratio
    whole, closed = measured.exact.closures, each.lips.closures
    return (
        f"look-ahead {each.look_ahead_ms:g} ms: lip opening r {r} with the whole recording, P B M "
        f"{closed.met} (whole: {whole.met}) of {whole.n}"
        + ("" if ratio is None else f", acceleration {ratio:.2f} x")
    )


def _count(n_samples: int) -> str:
    return "1 sample" if n_samples == 1 else f"{n_samples} samples"


def _megabytes(n_bytes: int) -> str:
    return f"{n_bytes / 1e6:,.1f} MB" if n_bytes >= 1e5 else f"{n_bytes / 1e3:,.1f} kB"
