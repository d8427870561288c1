"""Encoded speech that grows while it is spoken; see `Plan`.

Windows lie at fixed places of the waveform, so that what comes out does not depend on how the
waveform was cut into chunks.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping

import numpy as np

from facecode.arrays import AnyArray, Audio
from facecode.level import Level, RunningLevel
from facecode.live.plan import Plan
from facecode.live.rest import loudness_db
from facecode.speech import SpeechEncoder, WholeMemory

AHEAD = 3
"""Frames whose level a frame is told beside its own, and frames that a level is taken over."""


class LiveMemory:
    """The memory of the frames that have been heard and not been animated."""

    def __init__(self, encoder: SpeechEncoder, plan: Plan, primer: Audio) -> None:
        """Begin as if `primer`, of whole seconds, had been spoken before.

        Its frames are the first to come, and the windows that follow hear it.
        """
        self._encoder, self._plan = encoder, plan
        self._level = RunningLevel.of(primer) if encoder.normalises else None
        self._frames: deque[Mapping[str, AnyArray]] = deque()
        self._waveform, self._coming = primer, list[Audio]()
        self._n_heard = self._n_levelled = len(primer)
        self._origin = self._next_frame = round(len(primer) / plan.rate * plan.fps)
        self._start = self._n_dropped = 0
        self.levels: deque[list[float]] = deque()
        """Of each frame but the primer's, in dBFS: at the frame and at those after it, as heard."""
        primed = encoder.memory(primer, None if self._level is None else self._level.now)
        self._frames.extend(primed.frame(i) for i in range(primed.n_frames))

    @property
    def n_frames(self) -> int:
        """Frames so far, those of the primer included."""
        return self._n_dropped + len(self._frames)

    def frame(self, step: int) -> Mapping[str, AnyArray]:
        """See `Memory`; the frames before `step` are forgotten."""
        while self._n_dropped < step:
            self._frames.popleft()
            self._n_dropped += 1
        return self._frames[0]

    def hear(self, waveform: Audio) -> Iterator[None]:
        """Take in speech (n_samples,) at the bundle's rate; stop after every block."""
        self._coming.append(waveform)
        self._n_heard += len(waveform)
        while self._n_heard >= self._plan.needed(self._next_frame):
            self._encode_block()
            yield

    def skip(self, waveform: Audio) -> int:
        """Take in speech without encoding the blocks that it completes; the frames left out."""
        self._coming.append(waveform)
        self._n_heard += len(waveform)
        first = self._next_frame
        while self._n_heard >= self._plan.needed(self._next_frame):
            self._next_frame += self._plan.block
        start = self._plan.sample(max(0, self._next_frame - self._plan.context))
        self._cut(start, start)
        return self._next_frame - first

    def pad(self) -> None:
        """Close the block with silence, and encode it and those before as if silence followed."""
        plan = self._plan
        n_blocks = math.ceil((self._frames_heard() - self._origin) / plan.block)
        whole = self._origin + n_blocks * plan.block
        silence = plan.sample(whole) - self._n_heard
        self._coming.append(np.zeros(silence, np.float32))
        self._n_heard += silence
        while self._next_frame < whole:
            missing = max(0, plan.needed(self._next_frame) - self._n_heard)
            self._encode_block(np.zeros(missing, np.float32))

    def _frames_heard(self) -> int:
        n = math.ceil(self._n_heard * self._plan.fps / self._plan.rate)
        return n if self._plan.sample(n) >= self._n_heard else n + 1

    def end(self) -> None:
        """Encode what is left, without anything after it, as a recording ends."""
        window = self._plan.window(self._next_frame, self._n_heard)
        if window is None or window.stop - window.start < self._encoder.min_samples:
            return
        waveform = self._cut(window.start, window.stop)
        rest = self._encoder.memory(waveform, self._level_at(window.stop))
        self._take(rest, range(window.kept_from, rest.n_frames), window.stop)

    def _encode_block(self, after: Audio | None = None) -> None:
        plan = self._plan
        first = max(0, self._next_frame - plan.context)
        start, stop = plan.sample(first), min(plan.needed(self._next_frame), self._n_heard)
        piece = self._cut(start, stop)
        level = self._level_at(stop)
        if after is not None:
            piece = np.concatenate([piece, after])
        at = self._next_frame - first
        self._take(self._encoder.memory(piece, level), range(at, at + plan.block), stop)

    def _take(self, memory: WholeMemory, frames: range, heard: int) -> None:
        self._frames.extend(memory.frame(i) for i in frames)
        first = self._next_frame
        levels = [self._loudness(first + i, heard) for i in range(len(frames) + AHEAD)]
        self.levels.extend(levels[i : i + 1 + AHEAD] for i in range(len(frames)))
        self._next_frame += len(frames)

    def _loudness(self, frame: int, heard: int) -> float:
        """Level of the moment up to the end of `frame`, as far as was heard."""
        start, stop = self._plan.sample(max(0, frame - AHEAD + 1)), self._plan.sample(frame + 1)
        return loudness_db(self._waveform[start - self._start : min(stop, heard) - self._start])

    def _cut(self, start: int, stop: int) -> Audio:
        """Samples of the waveform; those of more than a second before `start` are forgotten."""
        kept = max(self._start, start - self._plan.rate)
        self._waveform = np.concatenate([self._waveform[kept - self._start :], *self._coming])
        self._start, self._coming = kept, []
        return self._waveform[start - kept : stop - kept]

    def _level_at(self, stop: int) -> Level | None:
        """The level of all that was heard before sample `stop`."""
        if self._level is None:
            return None
        new = self._waveform[self._n_levelled - self._start : stop - self._start]
        self._level, self._n_levelled = self._level.with_more(new), stop
        return self._level.now
