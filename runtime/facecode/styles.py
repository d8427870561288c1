"""Speaking styles: a name or a mix, to the weights that the decoder step takes."""

from __future__ import annotations

import difflib
import math
import warnings
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from facecode.arrays import Float32
from facecode.errors import StyleError, StyleWarning

Style: TypeAlias = "str | Mapping[str, float]"


def style_weights(style: Style | None, names: Sequence[str]) -> Float32:
    """Weights (n_styles,) float32 of a style; the first one when `style` is None.

    A mix is the weighted sum of the styles' vectors, weights as given.

    Raises:
        StyleError: unknown name, empty mix, or a weight that is no number.
    """
    if style is None:
        style = names[0]
    mix = {style: 1.0} if isinstance(style, str) else dict(style)
    if not mix:
        raise StyleError(f"the style mix is empty; choose from {', '.join(names)}")
    weights = np.zeros(len(names), dtype=np.float32)
    for name, weight in mix.items():
        if name not in names:
            raise StyleError(_unknown(name, names))
        if not isinstance(weight, (int, float)) or not math.isfinite(weight):
            raise StyleError(f"style {name!r} has the weight {weight!r}; expected a finite number")
        weights[names.index(name)] = weight
    total = sum(mix.values())
    if abs(total - 1) > 1e-3:
        warnings.warn(
            f"the style weights sum to {total:g}, not 1; the mix is used as given",
            StyleWarning,
            stacklevel=3,
        )
    return weights


def parse_style(text: str) -> Style:
    """`NAME`, or `a:0.3,b:0.7` as a mix.

    Raises:
        StyleError: a mix that cannot be read.
    """
    if ":" not in text:
        return text
    mix: dict[str, float] = {}
    for item in text.split(","):
        name, _, weight = item.strip().rpartition(":")
        try:
            mix[name] = float(weight)
        except ValueError:
            raise StyleError(
                f"got the style {text!r}; expected a name, or a mix such as a:0.3,b:0.7"
            ) from None
    return mix


def _unknown(name: str, names: Sequence[str]) -> str:
    by_case = {known.casefold(): known for known in names}
    near = difflib.get_close_matches(name.casefold(), by_case, n=3, cutoff=0.4)
    nearest = f"; nearest: {', '.join(by_case[n] for n in near)}" if near else ""
    return f"no style {name!r}{nearest}. This bundle has {', '.join(names)}"
