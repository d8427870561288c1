"""Results as a table for people and as plain values for machines.

Comes in: scored or judged clips. Goes out: text, and dicts that JSON can hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from typing import Any, TypeVar

import numpy as np

from facecode.animator import Animator
from facecode_exporter.evaluation.distances import ScoredClip, Take
from facecode_exporter.evaluation.diversity import DiversityScore, mean_score
from facecode_exporter.evaluation.speech import Judged, Pops, SpokenClip
from facecode_exporter.measures.lip_sync import Share, Verdict
from facecode_exporter.measures.metrics import pooled
from facecode_exporter.measures.signals import LONGEST_LAG, best_lag

ALL = "all"
T = TypeVar("T")
Plain = dict[str, Any]


def distances_table(clips: Sequence[ScoredClip], unit: str) -> str:
    """LVE, FDD and MVE: a line for each style where there are several, and one for all."""
    rows: list[tuple[str, ...]] = []
    rows.append(("", "clips", "frames", f"LVE ({unit}^2)", f"FDD ({unit}^2)", f"MVE ({unit})"))
    for name, group in _by_style(clips, lambda c: c.take.style or "").items():
        total = pooled(c.score for c in group)
        numbers = (f"{x:.4e}" for x in (total.lve, total.fdd, total.mve))
        rows.append((name, str(len(group)), f"{total.n_frames:,}", *numbers))
    cut = [sum(c.n_cut_prediction for c in clips), sum(c.n_cut_truth for c in clips)]
    note = f"\nnot compared: {cut[0]:,} last frames of predictions, {cut[1]:,} of the truth"
    return table(rows) + (note if any(cut) else "")


def distances_plain(clips: Sequence[ScoredClip]) -> Plain:
    """Pooled by style, and clip by clip."""

    def pool(group: Sequence[ScoredClip]) -> Plain:
        return {"n_clips": len(group), **asdict(pooled(c.score for c in group))}

    return {
        "pooled": {n: pool(g) for n, g in _by_style(clips, lambda c: c.take.style or "").items()},
        "clips": [
            {
                "clip": c.take.clip,
                "style": c.take.style,
                **asdict(c.score),
                "n_cut_prediction": c.n_cut_prediction,
                "n_cut_truth": c.n_cut_truth,
            }
            for c in clips
        ],
    }


def diversity_table(clips: Sequence[tuple[Take, DiversityScore]], unit: str) -> str:
    """Means over clips, a line a measure."""
    unit = unit if unit.isalpha() else "unit"
    units = {"alve": f"{unit}^2", "best_lve": f"{unit}^2"}
    mean = asdict(mean_score(score for _, score in clips))
    rows = [("", f"mean of {len(clips)} clips")]
    return table(
        rows + [(f"{n.upper()} ({units.get(n, unit)})", f"{v:.4g}") for n, v in mean.items()]
    )


def diversity_plain(clips: Sequence[tuple[Take, DiversityScore]]) -> Plain:
    """Means over clips, and clip by clip."""
    return {
        "mean": asdict(mean_score(score for _, score in clips)),
        "clips": [{"clip": t.clip, "style": t.style, **asdict(score)} for t, score in clips],
    }


def codes_line(clips: Sequence[ScoredClip], animator: Animator) -> str:
    """How many codes of each part's codebook the clips use."""
    shares = []
    start = 0
    for part in animator.engine.parts:
        if part.codebook is None:
            continue
        columns = slice(start, start + part.codes_per_frame)
        used = {
            int(c)
            for clip in clips
            if clip.codes is not None
            for c in np.unique(clip.codes[:, columns])
        }
        shares.append(f"{part.name} {len(used)} of {len(part.codebook.rows)}")
        start = columns.stop
    return f"codes in use: {', '.join(shares) or 'none, the system has no codebook'}"


def speech_table(clips: Sequence[SpokenClip], unit: str) -> str:
    """Lip sync: a line for each style where there are several, and one for all."""
    unit = unit if unit.isalpha() else "unit"
    head = ("", "P B M close", "open vowels open", "silences rest", "lag (frames)", "correlation")
    rows: list[tuple[str, ...]] = [(*head, f"pops ({unit}/s^2, x reference)", "lip pops")]
    for name, group in _by_style(clips, lambda c: c.style).items():
        plain = _pooled_speech(group)
        shares = (plain[kind] for kind in ("closures", "openings", "rests"))
        lag, correlation = plain["lag_frames"], plain["correlation"]
        rows.append(
            (
                name,
                *(_share_text(s) for s in shares),
                "-" if lag is None else f"{lag:+d}" if lag else "0",
                "-" if correlation is None else f"{correlation:.3f}",
                _pops_text(plain["face_pops"]),
                _pops_text(plain["lip_pops"]),
            )
        )
    return table(rows)


def speech_plain(clips: Sequence[SpokenClip]) -> Plain:
    """Pooled by style, and clip by clip with every phone that was judged."""
    return {
        "pooled": {
            n: _pooled_speech(group) for n, group in _by_style(clips, lambda c: c.style).items()
        },
        "clips": [
            {
                "clip": c.recording.name,
                "style": c.style,
                "n_frames": len(c.relative),
                **_pooled_speech([c]),
                "phones": {
                    "closures": _verdicts(c.closures.verdicts),
                    "openings": _verdicts(c.openings.verdicts),
                    "rests": _verdicts(c.rests.verdicts),
                },
            }
            for c in clips
        ],
    }


def table(rows: Sequence[Sequence[str]]) -> str:
    """Columns in line: the first to the left, numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = (
        [row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))]
        for row in rows
    )
    return "\n".join("  ".join(line).rstrip() for line in lines)


def _pooled_speech(clips: Sequence[SpokenClip]) -> Plain:
    rows = [c.correlations for c in clips if c.correlations is not None]
    lag = best_lag(rows)
    at_zero = [row[LONGEST_LAG] for row in rows if np.isfinite(row[LONGEST_LAG])]
    lip_pops = [c.lip_pops for c in clips if c.lip_pops is not None]
    return {
        "n_clips": len(clips),
        "closures": _share([c.closures for c in clips]),
        "openings": _share([c.openings for c in clips]),
        "rests": _share([c.rests for c in clips]),
        "lag_frames": None if lag is None else lag.frames,
        "correlation": None if lag is None else lag.correlation,
        "correlation_without_lag": float(np.mean(at_zero)) if at_zero else None,
        "face_pops": _median_pops([c.face_pops for c in clips]),
        "lip_pops": _median_pops(lip_pops),
    }


def _share(kinds: Sequence[Judged]) -> Plain:
    total = Share.of(v for judged in kinds for v in judged.verdicts)
    by_chance = sum(len(judged.verdicts) * (judged.chance or 0) for judged in kinds)
    chance = by_chance / total.n if total.n else None
    return {"n": total.n, "met": total.met, "share": total.share, "chance": chance}


def _median_pops(pops: Sequence[Pops]) -> Plain:
    """Medians over clips, so that one clip with a jump does not stand for all."""
    values = [p.value for p in pops if p.value is not None]
    ratios = [p.ratio for p in pops if p.ratio is not None]
    return {
        "value": float(np.median(values)) if values else None,
        "ratio": float(np.median(ratios)) if ratios else None,
    }


def _verdicts(verdicts: Iterable[Verdict]) -> list[Plain]:
    return [
        {
            "phone": v.phone.name,
            "start_s": v.phone.start_s,
            "end_s": v.phone.end_s,
            "opening": round(v.opening, 4),
            "met": v.met,
        }
        for v in verdicts
    ]


def _by_style(clips: Sequence[T], style: Callable[[T], str]) -> dict[str, list[T]]:
    """Groups in order of appearance where there are several; then all clips together."""
    groups: dict[str, list[T]] = {}
    for clip in clips:
        groups.setdefault(style(clip) or "no style", []).append(clip)
    return {**(groups if len(groups) > 1 else {}), ALL: list(clips)}


def _share_text(share: Plain) -> str:
    if share["share"] is None:
        return "-"
    return f"{100 * share['share']:.0f} % of {share['n']} (chance {100 * share['chance']:.0f} %)"


def _pops_text(pops: Plain) -> str:
    if pops["value"] is None:
        return "-"
    ratio = "" if pops["ratio"] is None else f" ({pops['ratio']:.2f} x)"
    return f"{pops['value']:.3g}{ratio}"
