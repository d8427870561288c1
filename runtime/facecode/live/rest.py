"""Rest in quiet, as an option: where nobody speaks the face comes to rest, and blinks now and then.

Models that learned from speech alone mumble in loud room tone. A gate follows the level of the
speech against the quietest of the last seconds; it opens before a word, since it hears ahead.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

import numpy as np

from facecode.arrays import Audio, Float32

ABOVE_DB = 9.0
"""Above the quietest moment somebody speaks: steady noise of rooms varies by 7 dB at most."""
QUIETEST_DB = -65.0
"""Below it nobody speaks, however quiet it was before."""
MEMORY_S, START_S, HOLD_S, OPEN_S, CLOSE_S = 5.0, 1.0, 0.3, 0.1, 0.25
PRE_EMPHASIS = 0.97
"""Rooms hum in the bass, where speech says little."""
BLINK_S, SOONEST_S, LATEST_S = 0.13, 2.4, 6.0
EYELIDS = ("eyeBlinkLeft", "eyeBlinkRight")


def loudness_db(waveform: Audio) -> float:
    """Level of a piece of speech (n_samples,) in dBFS, the bass weakened."""
    if len(waveform) < 2:
        return -math.inf
    wide = waveform.astype(np.float64)
    power = float(np.square(wide[1:] - PRE_EMPHASIS * wide[:-1]).mean())
    return 10 * math.log10(power) if power > 0 else -math.inf


class RestGate:
    """How far the face may leave its rest, frame by frame: 1 in speech, 0 in quiet."""

    def __init__(self, fps: float) -> None:
        """Begin open, as after quiet."""
        self._fps = fps
        self._levels: deque[float] = deque(maxlen=round(MEMORY_S * fps))
        self._open, self._held = 1.0, 0

    def next(self, levels: Sequence[float]) -> float:
        """The share for the next frame.

        Args:
            levels: in dBFS, at the frame and at the frames after it that are heard already.
        """
        self._levels.append(max(levels[0], QUIETEST_DB))
        is_start = len(self._levels) < START_S * self._fps
        quiet = QUIETEST_DB if is_start else min(self._levels)
        if max(levels) > quiet + ABOVE_DB:
            self._held = round(HOLD_S * self._fps)
            self._open = min(1.0, self._open + 1 / (OPEN_S * self._fps))
        elif self._held:
            self._held -= 1
        else:
            self._open = max(0.0, self._open - 1 / (CLOSE_S * self._fps))
        return self._open


class Blinks:
    """Blinks at irregular moments of quiet; the same moments every time."""

    def __init__(self, names: Sequence[str], fps: float) -> None:
        """For a rig of `names`; without eyelids nothing moves."""
        self._lids = [i for i, name in enumerate(names) if name in EYELIDS]
        self._n_units, self._fps = len(names), fps
        self._random = np.random.default_rng(0)
        self._length = max(2, round(BLINK_S * fps))
        self._wait, self._phase = self._interval(), 0

    def _interval(self) -> int:
        return round(self._random.uniform(SOONEST_S, LATEST_S) * self._fps)

    def next(self, openness: float) -> Float32:
        """Weights (K,) to add at the next frame; a blink begins only while the face rests."""
        weights = np.zeros(self._n_units, np.float32)
        if self._wait:
            self._wait -= 1
        elif self._phase or not openness:
            self._phase += 1
            weights[self._lids] = 1 - abs(2 * self._phase / (self._length + 1) - 1)
            if self._phase == self._length:
                self._wait, self._phase = self._interval(), 0
        return weights
