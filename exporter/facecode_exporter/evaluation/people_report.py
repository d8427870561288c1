"""What was measured of people and a model, as a table and a picture."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from facecode.writers import writing
from facecode_exporter.evaluation.people import Judged
from facecode_exporter.measures.mouth import (
    FRONT,
    OPEN,
    ROUNDED,
    TEETH,
    TONGUE,
    confidence,
    curve_around,
    describe,
)
from facecode_exporter.measures.phone import LIPS_TOGETHER

KINDS = {
    "P B M": sorted(LIPS_TOGETHER),
    "W": ("W",),
    "UW OW": ROUNDED,
    "F V": TEETH,
    "IY IH EY EH": FRONT,
    "AA AE AH AW AY AO": OPEN,
    "S Z T D N L": TONGUE,
}
PEOPLE_COLOUR, MODEL_COLOUR = "#3b6fb6", "#e08a2e"


def table(judged: Judged, who: str) -> str:
    """Every number of people and model side by side."""
    people, model = describe(judged.people), describe(judged.model)
    width = max(map(len, people))
    lines = [f"{len(judged.names)} clips, {who}", f"{'':<{width}}  {'people':>8}  {'model':>8}"]
    lines += [
        f"{name:<{width}}  {_number(people[name])}  {_number(model[name])}" for name in people
    ]
    each = judged.agreements()
    for what, i in (("r of the gap with the person's", 0), ("at each clip's best shift", 1)):
        values = [pair[i] for pair in each]
        low, high = confidence(values)
        median = float(np.nanmedian(values))
        lines.append(f"{what:<{width}}  {'':>8}  {median:8.2f}  ({low:.2f} to {high:.2f})")
    return "\n".join(lines)


def _number(value: float) -> str:
    return f"{value:8.2f}" if abs(value) < 100 else f"{value:8.0f}"


def plot(judged: Judged, path: Path) -> None:
    """Draw the mean gap around the start of each kind of sound to a PNG, whole or not at all."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 5.6), dpi=100, layout="constrained")
    axes = figure.subplots(2, 4, sharex=True, sharey=True).ravel()
    for axis, (kind, names) in zip(axes, KINDS.items(), strict=False):
        for speaker, colour, who in (
            (judged.people, PEOPLE_COLOUR, "people"),
            (judged.model, MODEL_COLOUR, "model"),
        ):
            times, gap = curve_around(speaker, names)
            axis.plot(1000 * times, gap, color=colour, label=who, linewidth=2)
        n = sum(1 for _ in judged.people.phones(names))
        axis.axvline(0, color="#9a9a9a", linewidth=0.8)
        axis.set_title(f"{kind} ({n})", fontsize=10)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].legend(frameon=False)
    for axis in axes[len(KINDS) :]:
        axis.set_axis_off()
    figure.supxlabel("ms after the start of the sound")
    figure.supylabel("gap between the lips, share of the speaker's range")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    with writing(path) as file:
        file.write(buffer.getvalue())
