"""A face that speaks while it listens: chunks of speech in, frames out.

Equivalence: the frames do not depend on how the speech was cut into chunks, to the bit, and are
those of `Animator.animate(..., mode="live")`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np

from facecode.arrays import AnyArray, Audio, Float32
from facecode.errors import StreamEndedError
from facecode.live.frame import LiveFrame
from facecode.live.intake import Intake
from facecode.live.loop import Piece
from facecode.live.plan import Plan
from facecode.live.rest import Blinks, RestGate
from facecode.live.voice import Voice
from facecode.loop.part import offsets_of, products_of
from facecode.loop.request import style_weights
from facecode.options import Style


class Stream:
    """One face, driven by one voice. It belongs to one caller at a time, and to no thread.

    Streams of one `Animator` share its loaded graphs, and nothing else.
    """

    def __init__(self, voice: Voice) -> None:
        """Begin anew; see `Animator.stream`."""
        self._voice = voice
        self._weights = self._target = voice.request.weights
        self._blend_left = 0
        self.reset()

    @property
    def plan(self) -> Plan:
        """How the stream hears."""
        return self._voice.plan

    @property
    def latency_ms(self) -> float:
        """What a frame waits for at most, beside computing: look-ahead, block and show delay."""
        return self.plan.latency_ms

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names (K,) of the weights of a frame."""
        return self._voice.weight_names

    def reset(self) -> None:
        """Begin anew, with the style that was asked for last: the next frame has index 0."""
        voice = self._voice
        request = dataclasses.replace(voice.request, weights=self._target)
        self._loop = voice.primed.loop(request, voice.plan)
        self._weights, self._blend_left = self._target, 0
        self._intake = Intake(voice.plan.rate)
        self._gate = RestGate(voice.plan.fps) if voice.rest_in_quiet else None
        units = () if voice.rig is None else voice.rig.names
        self._blinks = Blinks(units, voice.plan.fps)
        self._ended = False
        self.n_skipped = 0

    def feed(self, samples: AnyArray, sample_rate: int | None = None) -> list[LiveFrame]:
        """Hear a chunk of speech; the frames that can be shown now, none or more.

        Args:
            samples: (n,) or (n, n_channels), any n, floats in [-1, 1] or signed integers.
            sample_rate: in Hz, the same for all chunks; that of the chunk before by default, and
                of the first one the bundle's.

        Raises:
            StreamEndedError: after `finish`.
            NonFiniteAudioError, UnreadableAudioError, StreamRateError: the chunk was not taken.
        """
        return list(self._frames(self._take(samples, sample_rate)))

    def skip(self, samples: AnyArray, sample_rate: int | None = None) -> list[LiveFrame]:
        """Hear a chunk without animating it, to catch up: its frames are left out and counted.

        What was due before it is given. `n_skipped` counts the frames left out since the last
        `reset`; indices and times go on as if they had been shown. Errors as of `feed`.
        """
        piece, n = self._loop.skip(self._take(samples, sample_rate))
        self.n_skipped += n
        return self._shown(piece)

    def flush(self) -> list[LiveFrame]:
        """End an utterance and keep the voice: frames of all that was heard, as before silence.

        Time goes on at the end of the block.

        Raises:
            StreamEndedError: after `finish`.
        """
        self._refuse_ended()
        frames = list(self._frames(self._intake.drain()))
        return frames + self._shown(self._loop.pad())

    def finish(self) -> list[LiveFrame]:
        """End the stream: the frames of all that was heard, as of a recording that ends.

        Raises:
            StreamEndedError: after `finish`.
        """
        self._refuse_ended()
        self._ended = True
        frames = list(self._frames(self._intake.drain()))
        return frames + self._shown(self._loop.end())

    def restyle(self, style: Style, blend_s: float = 0.3) -> None:
        """Change the style for the frames to come, in even steps over `blend_s` seconds.

        Raises:
            StyleError
            ValueError: a negative time.
        """
        if not blend_s >= 0:
            raise ValueError(f"got a blend of {blend_s} s; expected 0 or more")
        self._target = style_weights(style, self._voice.styles)
        self._blend_left = max(1, round(blend_s * self.plan.fps / self.plan.block))
        self._blend()

    def _take(self, samples: AnyArray, sample_rate: int | None) -> Audio:
        self._refuse_ended()
        return self._intake.take(samples, sample_rate)

    def _refuse_ended(self) -> None:
        if self._ended:
            raise StreamEndedError("the stream has ended; call reset() to begin anew")

    def _frames(self, waveform: Audio) -> Iterator[LiveFrame]:
        for piece in self._loop.hear(waveform):
            yield from self._shown(piece)
            self._blend()

    def _blend(self) -> None:
        """One step to the style that was asked for: one a block, however chunks are cut."""
        if self._blend_left:
            step = (self._target - self._weights) / np.float32(self._blend_left)
            self._weights = self._weights + step if self._blend_left > 1 else self._target
            self._loop.restyle(self._weights)
            self._blend_left -= 1

    def _shown(self, piece: Piece) -> list[LiveFrame]:
        if not len(piece):
            return []
        weights, offsets = self._motion_of(piece)
        if self._gate is not None:
            weights, offsets = self._at_rest(piece, weights, offsets)
        return [
            LiveFrame(
                index=(at := piece.first + i),
                time_s=at / self.plan.fps,
                codes=codes,
                weights=None if weights is None else weights[i],
                offsets=None if offsets is None else offsets[i],
            )
            for i, codes in enumerate(piece.codes)
        ]

    def _motion_of(self, piece: Piece) -> tuple[Float32 | None, Float32 | None]:
        voice, parts = self._voice, self._voice.parts
        weights = offsets = None
        if voice.problem is not None:
            weights = voice.problem.solve(products_of(parts, piece.hidden, 1)[0])
        if voice.n_vertices is not None:
            offsets = offsets_of(parts, piece.hidden, 1, voice.n_vertices)[0]
        return weights, offsets

    def _at_rest(
        self, piece: Piece, weights: Float32 | None, offsets: Float32 | None
    ) -> tuple[Float32 | None, Float32 | None]:
        """The same motion, drawn to rest where nobody speaks, with blinks."""
        assert self._gate is not None, "asked for"
        rig = self._voice.rig
        share = np.array([self._gate.next(levels) for levels in piece.levels], np.float32)
        blinks = np.stack([self._blinks.next(float(each)) for each in share])
        if offsets is not None:
            moved = 0 if rig is None else np.einsum("tk,kvc->tvc", blinks, rig.deltas)
            offsets = offsets * share[:, None, None] + moved
        if weights is not None:
            weights = np.minimum(weights * share[:, None] + blinks, 1)
        return weights, offsets
