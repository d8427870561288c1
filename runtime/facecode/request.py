"""What a caller asks for beside the speech: mode and window, samples, held codes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from facecode.animation import Animation
from facecode.arrays import AnyArray
from facecode.errors import ModeError
from facecode.samples import Samples
from facecode.window import DEFAULT_WINDOW, SMALLEST_WINDOW

Mode: TypeAlias = Literal["exact", "window"]
MODES: tuple[Mode, ...] = ("exact", "window")
Held: TypeAlias = "Mapping[str, AnyArray | Animation]"
"""Codes (T, H) to keep, or a clip whose codes to keep, by part name."""


@dataclass(frozen=True)
class Request:
    """What to generate beside the speech."""

    window: int | None = None
    """Decode `window` frames for the feedback; None: the whole prefix."""
    samples: Samples | None = None
    hold: Held = field(default_factory=dict)
    progress: bool = False


def window_frames(mode: str, window: int | None, default: int = DEFAULT_WINDOW) -> int | None:
    """Frames to decode per step: None for the whole prefix.

    Raises:
        ModeError: unknown mode, `window` without window mode, or too small.
    """
    if mode not in MODES:
        raise ModeError(f"got mode {mode!r}; expected one of {', '.join(MODES)}")
    if mode == "exact":
        if window is not None:
            raise ModeError("a window goes with mode 'window'; exact decodes the whole prefix")
        return None
    if window is not None and window < SMALLEST_WINDOW:
        raise ModeError(
            f"got a window of {window} frames; expected at least {SMALLEST_WINDOW}, since the "
            "newest frame changes two before it"
        )
    return default if window is None else window
