"""The step loop of a stream: speech in, pieces of motion out."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from facecode.arrays import Audio, Codes, Float32
from facecode.live.memory import LiveMemory
from facecode.live.plan import Plan
from facecode.loop.engine import Engine
from facecode.loop.request import Request
from facecode.loop.step import run_step


@dataclass(frozen=True)
class Piece:
    """Frames that are shown at once."""

    first: int
    """Index of the first frame in the stream."""
    codes: Codes
    """(n, H)"""
    hidden: tuple[Float32, ...]
    """(1, n, E) of each part"""
    levels: tuple[list[float], ...] = ()
    """Of each frame; see `LiveMemory.levels`."""

    def __len__(self) -> int:
        return len(self.codes)


@dataclass
class _Waiting:
    """Frames of one part that have not been shown."""

    codes: list[Codes] = field(default_factory=list)
    hidden: list[Float32] = field(default_factory=list)


class LiveLoop:
    """One face that speaks on; frames come out in pieces, each when its speech has been heard."""

    def __init__(self, engine: Engine, request: Request, plan: Plan, primer: Audio) -> None:
        """Begin as if `primer` (n_samples,) had been spoken before.

        Raises:
            AudioTooShortError: a primer of less than a frame.
        """
        self._parts, self._encoder = engine.parts, engine.speech_encoder
        self.memory = LiveMemory(self._encoder, plan, primer)
        self._loops = engine.loops([self.memory], request)
        self._step = self._shown = 0
        self._waiting = [_Waiting() for _ in self._parts]
        self._advance()
        for loop in self._loops:
            loop.finish()
        self._take()
        self._shown = 0

    def copy(self) -> LiveLoop:
        """The same loop at the same moment, which goes on alone; graphs are shared."""
        shared = [self._encoder, self._parts]
        shared += [x for part in self._parts for x in (part, part.codebook, part.motion)]
        return copy.deepcopy(self, {id(each): each for each in shared})

    def restyle(self, weights: Float32) -> None:
        """Take style weights (n_styles,) for the frames to come."""
        for loop in self._loops:
            loop.restyle(weights[None])

    def hear(self, waveform: Audio) -> Iterator[Piece]:
        """Take in speech (n_samples,) at the bundle's rate; a piece for every block."""
        for _ in self.memory.hear(waveform):
            self._advance()
            yield self._take()

    def skip(self, waveform: Audio) -> tuple[Piece, int]:
        """Take in speech without animating it: what was due before it, and frames left out."""
        before = self._rest()
        n_skipped = self.memory.skip(waveform)
        self._shown += n_skipped
        return before, n_skipped

    def pad(self) -> Piece:
        """Show every frame of what was heard, as if silence followed."""
        self.memory.pad()
        return self._rest()

    def end(self) -> Piece:
        """Show every frame of what was heard, as a recording ends."""
        self.memory.end()
        return self._rest()

    def _rest(self) -> Piece:
        self._advance()
        for loop in self._loops:
            loop.finish()
        return self._take()

    def _advance(self) -> None:
        """Animate every frame that was encoded."""
        while self._step < self.memory.n_frames:
            codes = run_step(self._parts, self._loops, self._step, 1)
            for waiting, rows in zip(self._waiting, codes, strict=True):
                waiting.codes.append(rows[0])
            for loop in self._loops:
                loop.settle()
            self._step += 1

    def _take(self) -> Piece:
        for waiting, loop in zip(self._waiting, self._loops, strict=True):
            waiting.hidden += [hidden for _, hidden in loop.take_final()]
        hidden = [np.concatenate(w.hidden, axis=1) for w in self._waiting]
        n = min(each.shape[1] for each in hidden)
        if not n:
            return Piece(self._shown, np.empty((0, 0), np.int64), ())
        codes = np.concatenate([np.stack(w.codes[:n], axis=1)[0] for w in self._waiting], axis=1)
        for waiting, each in zip(self._waiting, hidden, strict=True):
            waiting.codes, waiting.hidden = waiting.codes[n:], [each[:, n:]]
        self._shown += n
        levels = self.memory.levels
        shown = tuple(levels.popleft() for _ in range(min(n, len(levels))))
        return Piece(self._shown - n, codes, tuple(each[:, :n] for each in hidden), shown)
