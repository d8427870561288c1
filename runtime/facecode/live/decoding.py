"""How a stream decodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from facecode.live.plan import DELAY_FRAMES, is_causal
from facecode.loop.request import Window, window_of
from facecode_spec.manifest import ModeEntry


def live_window(frames: int | None, modes: Mapping[str, ModeEntry], smallest: int) -> Window:
    """As `window` does, but that a frame is shown early; without codes, frame by frame.

    Args:
        frames: decoded at a step; by default the bundle's choice.
        modes: of the bundle.
        smallest: the fewest frames that a step can decode.

    Raises:
        ModeError
    """
    if frames is None and is_causal(modes):
        return Window(frames=1, delay=0)
    window = window_of("window", frames, modes, smallest)
    assert window is not None, "of mode window"
    return replace(window, delay=DELAY_FRAMES)
