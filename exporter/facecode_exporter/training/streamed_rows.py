"""Speech encoded as a stream hears it: block by block, each with a little before and after it.

The windows are those of `facecode.live`: a decoder that is trained on them hears in training what
it will hear live. Each clip has a plan of its own, drawn from its number, and begins as if another
clip had just been spoken.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby

import numpy as np
import torch
from torch import Tensor

from facecode.arrays import Audio, Float32
from facecode.level import RunningLevel
from facecode.live.plan import Plan

LOOK_AHEADS_S, CONTEXTS_S, BLOCKS_S = (0.1, 0.2, 0.3, 0.4), (1.0, 2.0), (0.1, 0.2)
TOGETHER = 16
"""Windows that are encoded at once, at most."""
BEFORE_S = 3
"""Of another clip, spoken before; as long as the runtime's primer."""


def random_plan(fps: float, rate: int, seed: int) -> Plan:
    """One of the plans that a stream may have."""
    rng = np.random.default_rng(seed)

    def frames(choices: tuple[float, ...]) -> int:
        return max(1, round(float(rng.choice(choices)) * fps))

    return Plan(
        fps, rate, look_ahead=frames(LOOK_AHEADS_S), block=frames(BLOCKS_S),
        context=frames(CONTEXTS_S),
    )  # fmt: skip


def streamed_rows(
    encode: Callable[[Float32], Tensor],
    waveform: Audio,
    before: Audio,
    plan: Plan,
    rows_per_frame: int,
    normalise: bool,
) -> Tensor:
    """Memory rows (T * rows per frame, width) of a clip, each frame as a stream hears it.

    Args:
        encode: waveforms (B, n_samples) to their rows (B, n, width); see `nets.speech`.
        waveform: (n_samples,) of the clip, not normalised.
        before: of whole seconds, spoken before it.
        plan: of the stream.
        rows_per_frame: of the system.
        normalise: whether the encoder wants the level gone; it is the running level of all that
            was heard.
    """
    spoken = np.concatenate([before, waveform])
    heard: list[Float32] = []
    kept: list[tuple[int, int | None]] = []
    level = RunningLevel.of(before) if normalise else None
    levelled = len(before)
    frame = round(len(before) / plan.rate * plan.fps)
    while (window := plan.window(frame, len(spoken))) is not None:
        if level is not None:
            level = level.with_more(spoken[levelled : window.stop])
            levelled = window.stop
        piece = spoken[window.start : window.stop]
        heard.append(piece if level is None else level.now.apply(piece))
        first = window.kept_from * rows_per_frame
        kept.append((first, None if window.is_last else first + plan.block * rows_per_frame))
        frame += plan.block
        if window.is_last:
            break
    rows = _encoded(encode, heard)
    return torch.cat([own[first:last] for own, (first, last) in zip(rows, kept, strict=True)])


def _encoded(encode: Callable[[Float32], Tensor], heard: list[Float32]) -> list[Tensor]:
    """The rows of each window; neighbours of one length are encoded together, in half the time."""
    rows: list[Tensor] = []
    for _, alike in groupby(heard, key=len):
        windows = list(alike)
        for first in range(0, len(windows), TOGETHER):
            rows.extend(encode(np.stack(windows[first : first + TOGETHER])))
    return rows


def whole_seconds(waveform: Audio, rate: int, seconds: int = BEFORE_S) -> Audio:
    """The last whole seconds of a clip, `seconds` at most; a clip of less than one is repeated."""
    while len(waveform) < rate:
        waveform = np.concatenate([waveform, waveform])
    n = min(seconds, len(waveform) // rate) * rate
    return waveform[-n:]
