"""Two speaking styles and what lies between them: how wide the mouth opens in each mix.

The paper's Fig. 5 shows that interpolating style vectors interpolates the motion (CodeTalker, Xing
et al., CVPR 2023). Comes in: an animator, a recording, two styles. Goes out: opening curves.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facecode.animator import Animator
from facecode.arrays import Float32
from facecode.audio import AudioSource
from facecode_exporter.evaluation.plots import save_figure
from facecode_exporter.measures.lip_sync import opening_curve


@dataclass(frozen=True)
class StyleMix:
    """Opening curves of mixes of two styles."""

    styles: tuple[str, str]
    shares: tuple[float, ...]
    """of the second style, rising from 0 to 1"""
    openings: tuple[Float32, ...]
    """(T,) for each share, in the bundle's unit, 0 at rest"""
    fps: float

    @property
    def means(self) -> tuple[float, ...]:
        """Mean opening for each share."""
        return tuple(float(curve.mean()) for curve in self.openings)


def mix_styles(
    animator: Animator,
    audio: AudioSource,
    styles: tuple[str, str],
    lip_pair: tuple[int, int],
    n_mixes: int = 5,
) -> StyleMix:
    """Animate `audio` in `n_mixes` mixes, both pure styles included.

    Raises:
        FacecodeError: see `Animator.animate`.
    """
    first, second = styles
    shares = tuple(float(s) for s in np.linspace(0, 1, n_mixes))
    mixes = [{first: 1 - share, second: share} for share in shares]
    clips = [animator.animate(audio, mix, mode="exact") for mix in mixes]
    curves = tuple(opening_curve(c.vertices, lip_pair, c.template) for c in clips)
    return StyleMix(styles, shares, curves, animator.manifest.fps)


def plot_mix(mix: StyleMix, path: Path) -> None:
    """Draw the curves to a PNG at `path`, whole or not at all; needs matplotlib.

    Raises:
        MissingExtraError, OutputFolderError, OutputWriteError.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 3.6), layout="constrained")
    curves, means = figure.subplots(1, 2, width_ratios=(4, 1))
    for share, opening in zip(mix.shares, mix.openings, strict=True):
        colour = (0.15 + 0.75 * share, 0.35, 0.85 - 0.7 * share)
        name = f"{1 - share:.2f} {mix.styles[0]}, {share:.2f} {mix.styles[1]}"
        curves.plot(np.arange(len(opening)) / mix.fps, opening, color=colour, lw=1.2, label=name)
    curves.set(xlabel="seconds", ylabel="mouth opening", title="The same sentence in five mixes")
    curves.legend(fontsize=7, frameon=False)
    curves.margins(x=0)
    means.plot(mix.shares, mix.means, color="black", marker="o", ms=4)
    means.set(xlabel=f"share of {mix.styles[1]}", title="mean opening")
    means.set_ylim(bottom=0)
    save_figure(figure, path)
