"""How a part's motion is fed back in `window` mode: the same work at every frame, for any length.

A step decodes the newest frames, whose convolution still changes, over a past of fixed size:

- the norm's mean and variance of all frames so far, exact;
- keys and values of up to PAST_SLOTS earlier frames, thinned evenly when there are more, of which
  the window's other frames are decoded again in turn, since they grow stale;
- one frame `delay` frames back, which is final then: it has `delay` frames of future context.
  A `delay` of less than the convolution reaches gives a frame before its convolution is final.

A clip of up to W frames comes out as in `exact`: nothing is thinned, and every frame is decoded
again at every step. What longer clips deviate by is measured at export; see docs/performance.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray, Float32, Vectors
from facecode.loop.part import MotionDecoder
from facecode.loop.protocols import Final
from facecode.loop.thinned_past import ThinnedPast

PAST_SLOTS = 128
LONGEST_PAST = 600
"""Frames that self-attention looks back, as many as the public code has rows for. The bias of the
slowest of four heads falls by a factor of e in 7,680 frames, so that no length makes the past
vanish; this one leaves clips of up to 20 s as they are. 300 loses 6 % of the codes at 30 s."""


@dataclass(frozen=True)
class _Decoded:
    """One call of the motion decoder."""

    feedback: Float32
    hidden: Float32
    """(rows, m, E) of the frames that are final"""
    activations: Float32
    keys: AnyArray
    values: AnyArray
    slots: NDArray[np.int64]
    """revisited, first among keys and values; the oldest of the newest frames is last"""


class WindowMotion:
    """The state of all rows, and the embedding of the motion of the newest frame."""

    longest_past = LONGEST_PAST

    def __init__(
        self,
        decoder: MotionDecoder,
        n_rows: int,
        vector_shape: tuple[int, ...],
        window: int,
        delay: int,
    ) -> None:
        """Begin without a frame.

        Args:
            decoder: the motion decoder of the part.
            n_rows: batch rows.
            vector_shape: (H, C).
            window: frames decoded at a step.
            delay: frames that follow a frame before it is final; `window` at least, or fewer than
                the convolution reaches ahead.
        """
        self._decoder = decoder
        self._final: list[Final] = []
        self._n_rows = n_rows
        self._n_newest = decoder.n_newest
        self._n_revisited = window - self._n_newest
        self._early = delay if delay < self._n_newest else None
        self._n_given = 0
        self._delay = max(delay, window)
        n_slots = max(PAST_SLOTS, window)
        self._past = ThinnedPast(n_slots)
        slots = (decoder.n_layers, n_rows, decoder.n_heads, n_slots, decoder.head_dim)
        self._keys, self._values = np.zeros(slots, np.float32), np.zeros(slots, np.float32)
        self._kept = np.zeros((n_rows, n_slots, decoder.dim), np.float32)
        self._waiting = np.zeros((n_rows, self._delay, decoder.dim), np.float32)
        self._vectors = np.zeros((n_rows, 0, *vector_shape), np.float32)
        self._n_frames = self._count = 0
        self._mean = np.zeros((n_rows, decoder.dim))
        self._squares = np.zeros((n_rows, decoder.dim))

    def append(self, vectors: Vectors) -> None:
        """Add the code vectors (rows, H, C) of one frame; rows that have ended are left out."""
        n = len(vectors)
        reach = self._vectors[:n, -(self._n_newest + self._decoder.reach.before - 1) :]
        self._vectors = np.concatenate([reach, vectors[:, None]], axis=1)
        self._n_frames += 1

    def feed_back(self, n: int) -> Float32:
        """(n, D) for the first `n` rows, after every frame; the others have ended."""
        if n < self._n_rows:
            self._finish(slice(n, self._n_rows))
            self._n_rows = n
        newest = self._n_frames - 1
        due = [newest - self._delay] if newest >= self._delay and self._early is None else []
        decoded = self._decode(slice(0, n), due, last=False)
        self._past.advance(decoded.slots)
        self._store(decoded.slots, decoded.keys, decoded.values)
        if decoded.activations.shape[1] == self._n_newest:
            self._retire(newest - self._n_newest + 1, decoded)
        if decoded.hidden.shape[1]:
            self._final.append((slice(0, n), decoded.hidden))
            self._n_given += decoded.hidden.shape[1]
        return decoded.feedback

    def finish(self) -> None:
        """Make the last frames final of the clips that have not ended before."""
        self._finish(slice(0, self._n_rows))

    def take_final(self) -> list[Final]:
        """See `MotionState`."""
        final, self._final = self._final, []
        return final

    def _finish(self, rows: slice) -> None:
        newest = self._n_frames - 1
        if self._early is not None and self._n_given == self._n_frames:
            return
        due = range(max(0, newest - self._delay), max(0, newest - self._n_newest + 1))
        known = [] if self._early is not None else list(due)
        self._final.append((rows, self._decode(rows, known, last=True).hidden))
        self._n_given = self._n_frames

    def _decode(self, rows: slice, due: list[int], last: bool) -> _Decoded:
        start = max(0, self._vectors.shape[1] - self._n_newest)
        vectors = self._vectors[rows]
        new = vectors[:, start:]
        slots = self._past.oldest_first(self._n_revisited)
        waiting = self._waiting[rows][:, [f % self._delay for f in due]]
        revisited = np.concatenate([self._kept[rows][:, slots], waiting], axis=1)
        n_revisited = revisited.shape[1]
        newest = n_revisited + new.shape[1] - 1
        final = self._final_of(len(slots), n_revisited, newest, last)
        log_weights = self._past.log_weights()
        own = np.concatenate([log_weights[slots], np.full(len(due), -np.inf, np.float32)])
        log_weights[slots] = -np.inf
        feedback, hidden, activations, keys, values = self._decoder.run(
            ("feedback", "hidden", "activations", "keys", "values"),
            new,
            final if last else np.append(final, newest),
            context=self._decoder.context(vectors, start),
            revisited=revisited,
            count=np.array(self._count, np.float32),
            mean=self._mean[rows].astype(np.float32),
            squares=self._squares[rows].astype(np.float32),
            past_log_weights=log_weights,
            revisited_log_weights=own,
            **self._decoder.past_inputs(self._keys[:, rows], self._values[:, rows]),
        )
        return _Decoded(feedback, hidden[:, : len(final)], activations, keys, values, slots)

    def _final_of(
        self, n_slots: int, n_revisited: int, newest: int, last: bool
    ) -> NDArray[np.int64]:
        """Places among the decoded frames of those that are final."""
        if self._early is None:
            return np.arange(n_slots, newest + 1 if last else n_revisited)
        first_given = newest - (self._n_frames - 1 - self._n_given)
        return np.arange(first_given, newest + 1 if last else newest - self._early + 1)

    def _store(self, slots: NDArray[np.int64], keys: AnyArray, values: AnyArray) -> None:
        """Fresh keys and values (layers, rows, heads, n, width) into their slots."""
        n_rows, n = keys.shape[1], len(slots)
        self._keys[:, :n_rows, :, slots] = keys[:, :, :, :n]
        self._values[:, :n_rows, :, slots] = values[:, :, :, :n]

    def _retire(self, frame: int, decoded: _Decoded) -> None:
        """Take a frame whose convolution is final into the sums (Welford 1962) and the past."""
        activation = decoded.activations[:, 0]
        n = len(activation)
        self._count += 1
        difference = activation - self._mean[:n]
        self._mean[:n] += difference / self._count
        self._squares[:n] += difference * (activation - self._mean[:n])
        self._waiting[:n, frame % self._delay] = activation
        slot = self._past.claim_slot(frame)
        if slot is not None:
            self._kept[:n, slot] = activation
            keys, values = decoded.keys[:, :, :, -1:], decoded.values[:, :, :, -1:]
            self._store(np.array([slot]), keys, values)
