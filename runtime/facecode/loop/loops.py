"""Which loop animates a part, by its kind and by what is asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facecode.errors import ModeError
from facecode.loop.decoder_step import DecoderStep
from facecode.loop.exact import PrefixMotion
from facecode.loop.held import HeldPart
from facecode.loop.offsets import OffsetsPart
from facecode.loop.part import Part, check_codes
from facecode.loop.request import Request
from facecode.loop.step import GeneratedPart, MotionState, PartLoop
from facecode.loop.window import LONGEST_PAST, WindowMotion
from facecode.speech import Memory


def loop_of(part: Part, memories: Sequence[Memory], request: Request) -> PartLoop:
    """The loop of `part` over clips of falling length, at frame 0.

    Raises:
        CodesError: held codes of another length.
        ModeError: held codes, and several clips.
    """
    if part.name in request.hold:
        return _held(part, memories, request)
    heads = request.heads[part.name]
    weights = np.broadcast_to(request.weights, (len(memories), part.n_styles))
    if part.codebook is None:
        longest_past = None if request.window is None else LONGEST_PAST
        return OffsetsPart(DecoderStep(part, memories, weights, heads, longest_past))
    motion = _motion(part, len(memories) * len(heads), request)
    step = DecoderStep(part, memories, weights, heads, motion.longest_past)
    return GeneratedPart(part.codebook, step, motion)


def _held(part: Part, memories: Sequence[Memory], request: Request) -> HeldPart:
    if len(memories) != 1:
        raise ModeError(f"got codes to hold and {len(memories)} recordings; expected one")
    codes = check_codes(request.hold[part.name], part, memories[0].n_frames)
    return HeldPart(part, codes[None])


def _motion(part: Part, n_rows: int, request: Request) -> MotionState:
    codebook, decoder = part.prior
    shape = (part.codes_per_frame, codebook.rows.shape[1])
    if request.window is None:
        return PrefixMotion(decoder, n_rows, shape)
    return WindowMotion(decoder, n_rows, shape, request.window.frames, request.window.delay)
