"""Phones to mouth shapes: dominance functions, then the contacts that speech cannot do without.

Comes in: phones, loudness per frame and a style. Goes out: (T, 52) ARKit weights of the mouth.
The blend follows Cohen and Massaro (1993): at each frame the shapes of all phones are averaged by
their dominance, which fades with the distance in time. Lips close for P, B and M and the lower lip
meets the teeth for F and V whatever the neighbours want. The same input gives the same weights.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facecode.arrays import Float32
from facecode_exporter.corpus.prosody import frame_times
from facecode_exporter.corpus.styles import Style
from facecode_exporter.corpus.visemes import (
    BY_HAND,
    FULL_SILENCE_S,
    JAW,
    LIP_ON_TEETH,
    LIPS,
    LOUDEST_GAIN,
    QUIETEST_GAIN,
    TIMING,
    VISEMES,
    VOWELS,
    articulator,
    split_diphthongs,
)
from facecode_exporter.head.face_units import FACE_UNITS, UNIT, unit_weights
from facecode_exporter.measures.phone import LIPS_TOGETHER, SILENCE, Phone

CONTACT = 0.25  # share of a phone, either side of its middle, that a contact is held
CONTACT_RAMP_S = 0.055
JAW_BEHIND_LIPS, JAW_ON_TEETH = 0.55, 0.35  # share of the jaw that stays open in a contact
WIDEST_JAW_ON_TEETH = 0.05
TYPICAL_DB = -3.0  # of a stressed vowel, below the loudest
# Units that part the lips, and so are off while they touch.
PARTING = (
    *("mouthFunnel", "mouthRollLower", "mouthLowerDown", "mouthUpperUp"),
    *("mouthShrugUpper", "mouthShrugLower"),
)

PRESSED = {
    "P": unit_weights(mouthRollLower=0.20, mouthRollUpper=0.12),
    "B": unit_weights(mouthRollLower=0.16, mouthRollUpper=0.10),
    "M": unit_weights(mouthRollLower=0.12, mouthRollUpper=0.08),
}
"""Lips that press roll in, and do not widen the mouth."""
BITING = {name: BY_HAND[name].shape for name in LIP_ON_TEETH}

_PARTS = {name: np.array([articulator(u) == name for u in FACE_UNITS]) for name in TIMING.reach_s}
_PARTING = unit_weights(**dict.fromkeys(PARTING, 1.0)) > 0
_SPREADING = unit_weights(mouthStretch=1, mouthSmile=1) > 0


def mouth_weights(phones: Sequence[Phone], loudness: Float32, style: Style, fps: float) -> Float32:
    """(T, 52) for phones that cover the T frames of `loudness` (dB, 0 is loud)."""
    times = frame_times(len(loudness), fps) + np.float32(style.lead_s)
    parts = split_diphthongs(phones)
    targets = np.stack([_target(phone, loudness, style, fps) for phone in parts])
    weights = np.zeros((len(times), len(FACE_UNITS)), np.float32)
    for name, units in _PARTS.items():
        share = _dominance(parts, times, name, style)
        share /= share.sum(axis=1, keepdims=True)
        weights[:, units] = share @ targets[:, units]
    weights += _held(style) * (1 - 0.7 * weights[:, [UNIT["mouthPucker"]]])
    for kinds, contact in ((LIP_ON_TEETH, _lip_on_teeth), (LIPS_TOGETHER, _lips_together)):
        for phone in phones:
            if phone.name in kinds:
                much = _bump(phone, times, fps)[:, None]
                weights = (1 - much) * weights + much * contact(weights, phone.name, style)
    return np.asarray(np.clip(weights, 0, 1), np.float32)


def _target(phone: Phone, loudness: Float32, style: Style, fps: float) -> Float32:
    gain = unit_weights() + 1
    gain[_PARTS[LIPS]] = style.lips
    gain[_PARTS[JAW]] = style.jaw
    gain[UNIT["mouthClose"]] = style.jaw  # or shut lips part where the jaw opens wider
    if phone.name in VOWELS:
        levels = loudness[round(phone.start_s * fps) : round(phone.end_s * fps) + 1]
        level = float(np.quantile(levels, 0.75)) if len(levels) else TYPICAL_DB
        louder = 1 + (level - TYPICAL_DB) * TIMING.jaw_per_db
        gain[_PARTS[JAW]] *= np.clip(louder, QUIETEST_GAIN, LOUDEST_GAIN)
    return VISEMES[phone.name].shape * gain


def _dominance(parts: Sequence[Phone], times: Float32, name: str, style: Style) -> Float32:
    """(T, n_phones), never all zero."""
    start, end = (np.array([p[k] for p in parts]) for k in (1, 2))
    strength = np.array([VISEMES[p.name].dominance[name] for p in parts])
    silent = np.array([p.name == SILENCE for p in parts])
    strength = strength * np.where(silent, np.minimum(1, (end - start) / FULL_SILENCE_S), 1)
    plateau = np.where(silent, 0.5, TIMING.plateau) * (end - start)
    late = np.array([VISEMES[p.name].late_s for p in parts])
    away = times[:, None] - ((start + end) / 2 + late)
    beyond = np.maximum(np.abs(away) - plateau, 0)
    before, after = TIMING.reach_s[name]
    faded = np.exp(-((beyond / (np.where(away < 0, before, after) * style.blur)) ** 1.3))
    return np.asarray(strength * np.maximum(faded, 1e-9))


def _held(style: Style) -> Float32:
    return unit_weights(
        mouthSmile=style.smile, cheekSquint=0.5 * style.smile, mouthFrown=style.frown
    )


def _bump(phone: Phone, times: Float32, fps: float) -> Float32:
    """(T,) 1 for at least one frame in the middle of the phone, falling off smoothly."""
    middle, length = (phone.start_s + phone.end_s) / 2, phone.end_s - phone.start_s
    hold = max(CONTACT * min(length, 0.2), 0.51 / fps)
    distance = np.abs(times - middle) - hold
    t = np.clip(1 - distance / CONTACT_RAMP_S, 0, 1)
    return np.asarray(t * t * (3 - 2 * t))


def _lips_together(weights: Float32, name: str, style: Style) -> Float32:
    """`mouthClose` undoes on the lips what `jawOpen` does, unit for unit."""
    closed = np.where(_PARTING, 0, weights)
    closed = np.where(_SPREADING, np.minimum(closed, 0.3), closed)
    jaw = JAW_BEHIND_LIPS * weights[:, UNIT["jawOpen"]]
    closed[:, UNIT["jawOpen"]] = jaw
    closed[:, UNIT["mouthClose"]] = jaw
    pressed = PRESSED[name] * style.press
    return np.asarray(np.maximum(closed, pressed))


def _lip_on_teeth(weights: Float32, name: str, style: Style) -> Float32:
    """The lower lip is rolled in under the upper teeth, which show."""
    biting = np.where(_PARTING, 0, weights)
    biting[:, UNIT["mouthPucker"]] *= 0.3
    biting[:, UNIT["mouthClose"]] = 0
    jaw = np.minimum(JAW_ON_TEETH * weights[:, UNIT["jawOpen"]], WIDEST_JAW_ON_TEETH)
    shape = BITING[name]
    biting[:, UNIT["jawOpen"]] = np.maximum(jaw, shape[UNIT["jawOpen"]])
    others = np.delete(np.arange(len(shape)), UNIT["jawOpen"])
    biting[:, others] = np.maximum(biting[:, others], (shape * min(style.lips, 1.0))[others])
    return np.asarray(biting)
