"""What a stream of a recording gives, as a clip."""

from __future__ import annotations

import dataclasses

import numpy as np

from facecode.animation import Animation
from facecode.errors import AudioTooShortError, ModeError
from facecode.live.stream import Stream
from facecode.live.voice import Voice
from facecode.options import BatchOptions, Held, Samples


def refuse_in_live(
    options: BatchOptions, samples: Samples | None = None, hold: Held | None = None
) -> None:
    """Refuse what does not go with mode `live`, or goes with it alone.

    Raises:
        ModeError
    """
    if options.get("mode") != "live":
        if options.get("look_ahead_ms") is not None:
            raise ModeError("a look-ahead goes with mode 'live'; the others hear the whole speech")
    elif samples is not None or hold:
        raise ModeError("mode 'live' gives one face and holds no part; leave samples and hold out")


def live_clip(voice: Voice, still: Animation) -> Animation:
    """All frames of a stream of the audio of `still`, which has none.

    Raises:
        AudioTooShortError: audio of less than one frame.
    """
    assert still.audio is not None, "given by the caller"
    stream = Stream(voice)
    frames = stream.feed(still.audio) + stream.finish()
    if not frames:
        raise AudioTooShortError(
            f"{len(still.audio)} samples of speech are less than one frame; give more of it"
        )
    weights = [frame.weights for frame in frames if frame.weights is not None]
    offsets = [frame.offsets for frame in frames if frame.offsets is not None]
    empty = np.empty((len(frames), 0, 3), np.float32)
    return dataclasses.replace(
        still,
        codes=np.stack([frame.codes for frame in frames]),
        offsets=np.stack(offsets) if offsets else empty,
        known_weights=np.stack(weights) if weights else None,
        mode="live",
    )
