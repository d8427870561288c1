"""How far `window` and int8 are from what they stand in for, on the packaged speech.

Codes are compared one by one. Two of the same motion may differ by a code that hardly shows, and a
loop that feeds itself goes on with it, so that the lips count too: the lip vertex error between
both, as a share of that between the face and its rest.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from facecode.animator import Animator
from facecode.arrays import Codes, Offsets
from facecode.audio import SPEECH, load_audio
from facecode_exporter.errors import DeviationError
from facecode_exporter.measures.metrics import lip_vertex_error
from facecode_spec.manifest import Deviation, ModeEntry

WINDOWS = (5, 8, 12, 16, 24)
ENOUGH_CODES, LITTLE_MOTION = 0.99, 0.01
"""A window is wide enough with so many codes equal, or with lips that deviate by so little."""
LEAST_CODES, MOST_MOTION = 0.8, 0.01
"""int8 is refused with fewer codes equal to float32's, or with lips that deviate by more."""


@dataclass(frozen=True)
class Motion:
    """What a bundle makes of the calibration audio."""

    codes: Codes
    """(T, H)"""
    offsets: Offsets
    """(T, V, 3)"""


def move(animator: Animator, window: int | None = None) -> Motion:
    """Animate the packaged speech in the first style."""
    speech, engine = load_audio(SPEECH, animator.manifest.sample_rate), animator.engine
    how = None if window is None else animator.window("window", window)
    codes, offsets = engine.animate(speech, engine.request(window=how))
    return Motion(codes[0], offsets[0])


def deviation(animator: Animator, truth: Motion, motion: Motion) -> Deviation:
    """How far `motion` is from `truth`; without known lips all vertices count as such."""
    known = "lips" in animator.manifest.regions
    lips = animator.bundle.region("lips") if known else np.arange(animator.manifest.n_vertices)
    motion_size = lip_vertex_error(np.zeros_like(truth.offsets), truth.offsets, lips)
    error = lip_vertex_error(motion.offsets, truth.offsets, lips)
    agreement = float((motion.codes == truth.codes).mean()) if truth.codes.size else None
    return Deviation(
        len(truth.codes), agreement, float(error / motion_size) if motion_size else 0.0
    )


def choose_window(animator: Animator, exact: Motion) -> ModeEntry:
    """Mode `window` with the narrowest of WINDOWS that is wide enough, or the widest."""
    for frames in WINDOWS:
        found = deviation(animator, exact, move(animator, frames))
        if _enough(found, ENOUGH_CODES) or found.lip_deviation <= LITTLE_MOTION:
            break
    return dataclasses.replace(animator.manifest.modes["window"], window=frames, deviation=found)


def _enough(found: Deviation, share: float) -> bool:
    """Whether codes, where there are any, agree at least so often."""
    return found.code_agreement is not None and found.code_agreement >= share


def describe_deviation(found: Deviation) -> str:
    """A deviation in a line."""
    agreement = found.code_agreement
    codes = "" if agreement is None else f"{100 * agreement:.2f} % of the codes, "
    return (
        f"{codes}lips deviate by {100 * found.lip_deviation:.2f} % of their motion "
        f"({found.n_frames} frames)"
    )


def require_small(found: Deviation) -> None:
    """Refuse int8 weights that change too much.

    Raises:
        DeviationError
    """
    has_codes = found.code_agreement is not None
    if (has_codes and not _enough(found, LEAST_CODES)) or not found.lip_deviation <= MOST_MOTION:
        least = f"at least {100 * LEAST_CODES:g} % of the codes, and " if has_codes else ""
        raise DeviationError(
            f"int8 against float32: {describe_deviation(found)}; expected {least}lips within "
            f"{100 * MOST_MOTION:g} %. Export float32, or accept it with --any-deviation"
        )
