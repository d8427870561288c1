"""A picture of one clip: how far the mouth opens, against the sounds.

Comes in: a judged clip. Goes out: a PNG. Needs matplotlib, which is imported when drawing.
"""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from facecode.errors import MissingExtraError
from facecode.writers import writing
from facecode_exporter.evaluation.speech import SpokenClip
from facecode_exporter.measures.lip_sync import CLOSED_BELOW, OPEN_ABOVE
from facecode_exporter.measures.phone import LIPS_TOGETHER, OPEN_VOWELS, SILENCE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ROW_S = 4.0
"""Seconds in one row; phone names stay readable."""
ROW_INCHES, WIDTH_INCHES, DPI = 2.3, 14.0, 100
LOWEST, HIGHEST = -0.3, 1.6
COLOURS = (
    (LIPS_TOGETHER, "#3b6fb6", "P B M: close"),
    (OPEN_VOWELS, "#e08a2e", "open vowels"),
    (frozenset((SILENCE,)), "#9a9a9a", "silence"),
)
MISSED = "#c22030"


def require_matplotlib() -> None:
    """Raise now, before the work is done, if pictures cannot be drawn.

    Raises:
        MissingExtraError
    """
    try:
        import matplotlib.figure  # noqa: F401
    except ModuleNotFoundError as error:
        raise MissingExtraError.of("a plot", str(error.name), "plots") from error


def plot_opening(clip: SpokenClip, path: Path) -> None:
    """Draw the opening curve of `clip` and its phones to a PNG at `path`, whole or not at all.

    A red mark stands on each phone that does not get what it demands.

    Raises:
        MissingExtraError, OutputFolderError, OutputWriteError.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    n_rows = max(1, math.ceil(len(clip.relative) / clip.fps / ROW_S))
    figure = Figure(figsize=(WIDTH_INCHES, 0.8 + ROW_INCHES * n_rows), layout="constrained")
    rows = figure.subplots(n_rows, squeeze=False)[:, 0]
    for index, axes in enumerate(rows):
        _draw_phones(axes, clip)
        _draw_curves(axes, clip)
        axes.set_xlim(index * ROW_S, (index + 1) * ROW_S)
        axes.set_ylim(LOWEST, HIGHEST)
        axes.set_yticks([0, 0.5, 1])
        axes.set_ylabel("opening (1 = full)")
        axes.margins(0)
    rows[-1].set_xlabel("seconds")
    figure.suptitle(f"{clip.recording.name}, style {clip.style}")
    handles, labels = rows[0].get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    figure.legend(named.values(), named.keys(), loc="outside lower center", ncols=8, frameon=False)
    save_figure(figure, path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a PNG, whole or not at all.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=DPI)
    with writing(path) as file:
        file.write(picture.getbuffer())


def _draw_phones(axes: Axes, clip: SpokenClip) -> None:
    for i, phone in enumerate(clip.recording.phones):
        for names, colour, label in COLOURS:
            if phone.name in names:
                axes.axvspan(
                    phone.start_s, phone.end_s, color=colour, alpha=0.25, lw=0, label=label
                )
        axes.axvline(phone.start_s, ymax=0.06, color="black", lw=0.5)
        axes.text(
            *((phone.start_s + phone.end_s) / 2, HIGHEST - 0.05 - 0.13 * (i % 2), phone.name),
            ha="center", va="top", fontsize=8, clip_on=True,
        )  # fmt: skip
    for verdict in clip.verdicts:
        if not verdict.met:
            middle = (verdict.phone.start_s + verdict.phone.end_s) / 2
            axes.plot(middle, HIGHEST - 0.42, "v", color=MISSED, label="missed", ls="none")


def _draw_curves(axes: Axes, clip: SpokenClip) -> None:
    if clip.reference is not None:
        axes.plot(
            np.arange(len(clip.reference)) / clip.fps, clip.reference,
            color="black", lw=0.9, ls="--", alpha=0.6, label="reference",
        )  # fmt: skip
    axes.plot(
        np.arange(len(clip.relative)) / clip.fps, clip.relative,
        color="black", lw=1.3, marker=".", ms=3, label="opening",
    )  # fmt: skip
    for level, label in ((CLOSED_BELOW, "closed below"), (OPEN_ABOVE, "open above")):
        axes.axhline(level, color="black", lw=0.6, ls=":")
        axes.text(
            *(1.002, level, f"{label} {level:.0%}"),
            transform=axes.get_yaxis_transform(), fontsize=7, va="center",
        )  # fmt: skip
