"""What a caller may ask for beside the recording: the options of every door, said once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, TypeAlias, TypedDict

from facecode.arrays import AnyArray
from facecode.clip import Clip
from facecode.errors import StyleError
from facecode.template import TemplateSource

Mode: TypeAlias = Literal["auto", "exact", "window", "live"]
MODES: tuple[Mode, ...] = ("auto", "exact", "window", "live")
Style: TypeAlias = "str | Mapping[str, float]"
"""A style's name, or a mix {name: weight}."""
Samples: TypeAlias = "int | Mapping[str, int]"
"""How many faces, or how many samples by part name."""
Held: TypeAlias = "Mapping[str, AnyArray | Clip]"
"""Codes (T, H) to keep, or a clip whose codes to keep, by part name."""


class BatchOptions(TypedDict, total=False):
    """Options that serve one recording or many."""

    mode: Mode
    """`exact` gives the trained system's codes; `window` costs the same at every frame; `auto`, the
    default, is `exact` up to 15 s of speech and `window` beyond. `live` gives, of one recording,
    what a stream of it gives."""
    window: int | None
    """Frames that `window` decodes at a step, 3 or more; the bundle's choice by default."""
    template: TemplateSource | None
    """Another neutral face of the same topology: the name of one of the bundle's identities, or
    .npy, .ply, .obj or (V, 3)."""
    sample_rate: int | None
    """Of audio arrays, in Hz; the bundle's rate by default."""
    vertices: bool
    """False: weights of the rig's units alone, without forming a vertex; True by default."""
    look_ahead_ms: float | None
    """Speech after a frame's block that mode `live` hears, 100 or more; 200 by default."""


class Options(BatchOptions, total=False):
    """Options of one recording."""

    hold: Held | None
    """Parts to keep as they are, by name."""
    progress: bool
    """Show a bar on stderr."""


def parse_style(text: str | None) -> Style | None:
    """`NAME`, or `a:0.3,b:0.7` as a mix; None stays None.

    Raises:
        StyleError: a mix that cannot be read.
    """
    if text is None or ":" not in text:
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
