"""How a stream decodes."""

from __future__ import annotations

from dataclasses import replace

from facecode.live.plan import is_causal, live_entry
from facecode.loop.request import Window, window_of
from facecode_spec.manifest import Manifest


def live_window(frames: int | None, manifest: Manifest, smallest: int) -> Window:
    """As `window` does, but that a frame is shown early; without codes, frame by frame.

    Args:
        frames: decoded at a step; by default the bundle's choice.
        manifest: of the bundle.
        smallest: the fewest frames that a step can decode.

    Raises:
        ModeError
    """
    if frames is None and is_causal(manifest.modes):
        return Window(frames=1, delay=0)
    window = window_of("window", frames, manifest.modes, smallest)
    assert window is not None, "of mode window"
    return replace(window, delay=live_entry(manifest).delay_frames)
