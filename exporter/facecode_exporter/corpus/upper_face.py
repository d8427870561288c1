"""Blinks, brows and gaze: what a face does beside the mouth, never quite the same.

Comes in: loudness and pitch per frame, phones, a style and a random generator. Goes out: (T, 52)
ARKit weights of the upper face. Most blinks and brow raises belong to something that one hears, a
pause or a stressed vowel, so that a network which listens can learn when; some are free, and so
is most of the gaze. The same generator state gives the same weights.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from facecode.arrays import Float32
from facecode_exporter.corpus.prosody import frame_times
from facecode_exporter.corpus.styles import Style
from facecode_exporter.corpus.visemes import VOWELS
from facecode_exporter.head.face_units import FACE_UNITS, UNIT, unit_weights
from facecode_exporter.measures.phone import SILENCE, Phone

# (seconds from the start, how far shut); 115 ms beyond half, as people's 80 to 150
BLINK = ((0.0, 0.0), (0.05, 1.0), (0.10, 1.0), (0.18, 0.0))
SHORTEST_BETWEEN_BLINKS_S = 0.7
TYPICAL_BLINKS_PER_S = 0.3
PAUSE_S = 0.2  # silence that counts as a pause
LIKELY = 0.9  # chance of what belongs to a stressed vowel
FREE_BLINKS = 0.1  # share of a style's rate that comes at any time
BLINK_STRESS = 1.5  # standard deviations above the mean vowel, at the typical rate
RAISE_S = 0.16  # to the top of a brow raise, and 1.5 times as long down
STRESSED = 0.6  # standard deviations above the mean vowel
LOWERED = 0.3  # gaze in a pause
LOWER_S = 0.12
FIXATION_S = 1.1  # mean time between eye movements
DART_S = 0.045
FARTHEST = 0.45  # weight of the widest glance
RIGHT = np.array([unit.endswith("Right") for unit in FACE_UNITS])

Generator = np.random.Generator


def upper_face_weights(
    phones: Sequence[Phone],
    loudness: Float32,
    pitch: Float32,
    style: Style,
    rng: Generator,
    fps: float,
) -> Float32:
    """(T, 52) for phones that cover the T frames of `loudness` and `pitch`."""
    times = frame_times(len(loudness), fps)
    weights = np.zeros((len(times), len(FACE_UNITS)), np.float32)
    weights += unit_weights(
        browDown=style.brow_down,
        browInnerUp=style.brow_up,
        browOuterUp=0.7 * style.brow_up,
        eyeSquint=style.squint,
        eyeWide=0.5 * max(style.brow_up - 0.1, 0),
    )
    vowels = [p for p in phones if p.name in VOWELS]
    stress = _stress(vowels, loudness, pitch, times)
    weights += _brow_raises(vowels, stress, style, rng, times)
    weights += _gaze(phones, style, rng, times)
    shut = _blinks(phones, vowels, stress, style, rng, times)[:, None]
    opened = unit_weights(eyeSquint=1, eyeWide=1) * shut
    weights = weights * (1 - opened) + shut * unit_weights(eyeBlink=1)
    return np.asarray(np.clip(weights, 0, 1), np.float32)


def _blinks(
    phones: Sequence[Phone],
    vowels: Sequence[Phone],
    stress: Float32,
    style: Style,
    rng: Generator,
    times: Float32,
) -> Float32:
    """(T,) 0 open to 1 shut: where pauses begin, after most strong stresses, and at random."""
    total_s = float(times[-1]) if len(times) else 0.0
    rate = style.blinks_per_s / TYPICAL_BLINKS_PER_S
    free = style.blinks_per_s * (FREE_BLINKS if vowels else 1.0)
    stressed = [
        v.end_s for v, s in zip(vowels, stress, strict=True) if s > BLINK_STRESS + 0.5 * (1 - rate)
    ]
    starts = [p.start_s + 0.05 for p in _pauses(phones)]
    for start in (
        *(start for start in stressed if rng.random() < LIKELY),
        *rng.uniform(0, max(total_s, 1e-3), rng.poisson(free * total_s)),
    ):
        if all(abs(start - other) > SHORTEST_BETWEEN_BLINKS_S for other in starts):
            starts.append(start)
    shut = np.zeros(len(times))
    at, value = zip(*BLINK, strict=True)
    for start in starts:
        shut = np.maximum(shut, np.interp(times - start, at, value, left=0, right=0))
    return np.asarray(shut, np.float32)


def _pauses(phones: Sequence[Phone]) -> list[Phone]:
    """Those after something was said."""
    return [
        p for p in phones if p.name == SILENCE and p.start_s > 0 and p.end_s - p.start_s > PAUSE_S
    ]


def _brow_raises(
    vowels: Sequence[Phone], stress: Float32, style: Style, rng: Generator, times: Float32
) -> Float32:
    """Brows go up, nearly always, with vowels that are louder and higher than the others."""
    weights = np.zeros((len(times), len(FACE_UNITS)), np.float32)
    inner_and_outer = unit_weights(browInnerUp=1.0, browOuterUp=0.8)
    for vowel, strength in zip(vowels, stress, strict=True):
        chance, size, tilt = rng.random(), rng.uniform(0.8, 1.0), rng.uniform(0.7, 1.0)
        if strength > STRESSED and chance < LIKELY:
            height = style.brow_activity * size * min(1.0, strength / 2)
            middle = (vowel.start_s + vowel.end_s) / 2
            away = (times - middle) / np.where(times < middle, RAISE_S, 1.5 * RAISE_S)
            bump = height * np.exp(-(away**2))[:, None]
            weights = np.maximum(weights, bump * np.where(RIGHT, tilt, 1) * inner_and_outer)
    return np.asarray(weights, np.float32)


def _stress(vowels: Sequence[Phone], loudness: Float32, pitch: Float32, times: Float32) -> Float32:
    """(n_vowels,) in standard deviations: 1 semitone counts like 1 dB."""
    scores = []
    for vowel in vowels:
        during = (times >= vowel.start_s) & (times <= vowel.end_s + times[1])
        high = pitch[during][np.isfinite(pitch[during])]
        loud = loudness[during].max() if during.any() else -60.0
        scores.append(loud + (high.max() if len(high) else 0.0))
    values = np.array(scores, np.float32)
    return (values - values.mean()) / (values.std() + 1e-3) if len(values) else values


def _gaze(phones: Sequence[Phone], style: Style, rng: Generator, times: Float32) -> Float32:
    """The eyes rest on a point near the viewer's face, then dart to another; lower in pauses."""
    total_s = float(times[-1]) if len(times) else 0.0
    moments, points = [0.0], [_glance(style, rng)]
    while moments[-1] < total_s:
        moments.append(moments[-1] + 0.2 + rng.exponential(FIXATION_S))
        points.append(_glance(style, rng))
    at, held = np.array(moments), np.array(points)
    knots = np.concatenate([at[1:], at[1:] + DART_S])
    order = np.argsort(knots, kind="stable")
    values = np.concatenate([held[:-1], held[1:]])[order]
    left, up = (np.interp(times, knots[order], values[:, k]) for k in (0, 1))
    for pause in _pauses(phones):
        inside = np.minimum(times - pause.start_s, pause.end_s - times) / LOWER_S
        up = up - LOWERED * np.clip(inside, 0, 1)
    weights = np.zeros((len(times), len(FACE_UNITS)), np.float32)
    for unit, much in (
        ("eyeLookOutLeft", left),
        ("eyeLookInRight", left),
        ("eyeLookInLeft", -left),
        ("eyeLookOutRight", -left),
        ("eyeLookUpLeft", up),
        ("eyeLookUpRight", up),
        ("eyeLookDownLeft", -up),
        ("eyeLookDownRight", -up),
    ):
        weights[:, UNIT[unit]] = np.maximum(much, 0)
    return weights


def _glance(style: Style, rng: Generator) -> tuple[float, float]:
    left, up = rng.normal(0, 0.5 * FARTHEST * style.gaze * np.array([1.0, 0.6]))
    return float(np.clip(left, -FARTHEST, FARTHEST)), float(np.clip(up, -FARTHEST, FARTHEST))
