"""What the mouth does for each ARPABET phone, in ARKit face units.

A viseme has a shape and, for jaw, lips and tongue apart, a dominance: how much it insists on its
shape against its neighbours (Cohen and Massaro 1993). BY_HAND are numbers of ours, chosen on the
demo head. VISEMES are those of `visemes.json`, which `facecode-export fit-visemes` made from the
tracks of a speaker of the GRID corpus (CC BY 4.0); sounds that he never says are by hand.
Diphthongs are two visemes in a row.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

from facecode.arrays import Float32
from facecode_exporter.head.face_units import FACE_UNITS, unit_weights
from facecode_exporter.measures.phone import OPEN_VOWELS, SILENCE, Phone

JAW, LIPS, TONGUE = "jaw", "lips", "tongue"
LIP_ON_TEETH = frozenset("FV")
FULL_SILENCE_S = 0.25  # shorter silences rest less
QUIETEST_GAIN, LOUDEST_GAIN = 0.65, 1.2  # of the jaw in vowels
VOWELS = OPEN_VOWELS | {"AH", "EH", "ER", "EY", "IH", "IY", "OW", "OY", "UH", "UW"}


def articulator(unit: str) -> str:
    """Which of jaw, lips and tongue moves a face unit."""
    if unit.startswith("jaw"):
        return JAW
    return TONGUE if unit == "tongueOut" else LIPS


@dataclass(frozen=True)
class Viseme:
    """A mouth shape and how strongly jaw, lips and tongue hold to it."""

    shape: Float32
    """(52,)"""
    dominance: Mapping[str, float] = field(default_factory=dict)
    late_s: float = 0.0
    """how long after the middle of its sound it is strongest"""


@dataclass(frozen=True)
class Timing:
    """How far sounds reach into their neighbours, and how much louder vowels open the jaw."""

    reach_s: Mapping[str, tuple[float, float]]
    """of jaw, lips and tongue: before and after the sound"""
    plateau: float
    """share of a sound, either side of its middle, at full dominance"""
    jaw_per_db: float
    """gain of the jaw in a vowel, for each dB"""

    @classmethod
    def by_hand(cls) -> Timing:
        """The timing that goes with BY_HAND."""
        reach = {JAW: (0.055, 0.055), LIPS: (0.070, 0.070), TONGUE: (0.040, 0.040)}
        return cls(reach, 0.3, 0.04)


def _viseme(jaw: float, lips: float, tongue: float = 0.1, **shape: float) -> Viseme:
    return Viseme(unit_weights(**shape), {JAW: jaw, LIPS: lips, TONGUE: tongue})


BY_HAND: Mapping[str, Viseme] = {
    SILENCE: _viseme(0.9, 0.8, 0.6),
    # open to close, spread
    "AA": _viseme(1.4, 0.5, jawOpen=0.42, mouthLowerDown=0.12, mouthUpperUp=0.05),
    "AE": _viseme(
        1.4, 0.7, jawOpen=0.36, mouthStretch=0.22, mouthLowerDown=0.22, mouthUpperUp=0.12
    ),
    "AH": _viseme(1.0, 0.3, jawOpen=0.24, mouthLowerDown=0.10),
    "EH": _viseme(
        1.3, 0.6, jawOpen=0.30, mouthStretch=0.20, mouthLowerDown=0.18, mouthUpperUp=0.08
    ),
    "IH": _viseme(
        1.0, 0.6, jawOpen=0.19, mouthStretch=0.22, mouthLowerDown=0.15, mouthUpperUp=0.06
    ),
    "IY": _viseme(
        1.1,
        1.0,
        jawOpen=0.13,
        mouthSmile=0.22,
        mouthStretch=0.28,
        mouthLowerDown=0.20,
        mouthUpperUp=0.10,
    ),
    # rounded
    "AO": _viseme(1.4, 0.9, jawOpen=0.32, mouthFunnel=0.38, mouthPucker=0.10),
    "UH": _viseme(1.0, 0.9, jawOpen=0.15, mouthFunnel=0.32, mouthPucker=0.22),
    "UW": _viseme(1.0, 1.3, jawOpen=0.09, mouthFunnel=0.22, mouthPucker=0.72),
    "OW": _viseme(1.3, 1.2, jawOpen=0.22, mouthFunnel=0.52, mouthPucker=0.30),
    "ER": _viseme(0.9, 0.9, jawOpen=0.14, mouthFunnel=0.30, mouthPucker=0.22),
    # lips
    "P": _viseme(0.5, 1.6, mouthPress=0.35),
    "B": _viseme(0.5, 1.6, mouthPress=0.28),
    "M": _viseme(0.5, 1.6, mouthPress=0.24),
    "F": _viseme(0.9, 1.5, jawOpen=0.05, mouthRollLower=0.55, mouthUpperUp=0.48),
    "V": _viseme(0.9, 1.4, jawOpen=0.05, mouthRollLower=0.48, mouthUpperUp=0.42),
    "W": _viseme(0.6, 1.5, jawOpen=0.06, mouthPucker=0.85, mouthFunnel=0.12),
    # tongue and teeth
    "TH": _viseme(
        0.7, 0.6, 1.5, jawOpen=0.12, tongueOut=0.72, mouthLowerDown=0.18, mouthUpperUp=0.14
    ),
    "DH": _viseme(
        0.5, 0.5, 1.3, jawOpen=0.11, tongueOut=0.66, mouthLowerDown=0.15, mouthUpperUp=0.12
    ),
    "T": _viseme(0.5, 0.4, 0.9, jawOpen=0.06, mouthLowerDown=0.14, mouthUpperUp=0.08),
    "D": _viseme(0.5, 0.4, 0.9, jawOpen=0.07, mouthLowerDown=0.14, mouthUpperUp=0.08),
    "N": _viseme(0.45, 0.3, 0.9, jawOpen=0.08, mouthLowerDown=0.12, mouthUpperUp=0.06),
    "L": _viseme(0.45, 0.3, 1.1, jawOpen=0.13, tongueOut=0.25, mouthLowerDown=0.12),
    "S": _viseme(
        0.9, 0.8, 0.8, jawOpen=0.03, mouthStretch=0.20, mouthLowerDown=0.24, mouthUpperUp=0.14
    ),
    "Z": _viseme(
        0.9, 0.8, 0.8, jawOpen=0.03, mouthStretch=0.18, mouthLowerDown=0.22, mouthUpperUp=0.14
    ),
    "SH": _viseme(
        0.9, 1.3, 0.6, jawOpen=0.05, mouthFunnel=0.46, mouthPucker=0.14, mouthUpperUp=0.10
    ),
    "R": _viseme(0.4, 1.0, 0.6, jawOpen=0.09, mouthFunnel=0.24, mouthPucker=0.34),
    "Y": _viseme(0.4, 0.6, 0.3, jawOpen=0.08, mouthStretch=0.22, mouthSmile=0.10),
    # behind the teeth: the lips are free
    "K": _viseme(0.35, 0.15, 0.4, jawOpen=0.11, mouthLowerDown=0.08),
    "G": _viseme(0.35, 0.15, 0.4, jawOpen=0.11, mouthLowerDown=0.08),
    "NG": _viseme(0.35, 0.15, 0.4, jawOpen=0.11, mouthLowerDown=0.08),
    "HH": _viseme(0.2, 0.08, 0.2, jawOpen=0.14),
}


def as_json(visemes: Mapping[str, Viseme], timing: Timing) -> dict[str, Any]:
    """Plain values for a JSON file; units that are 0 are left out."""
    return {
        "timing": {
            "reach_s": {k: [round(x, 4) for x in v] for k, v in timing.reach_s.items()},
            "plateau": round(timing.plateau, 4),
            "jaw_per_db": round(timing.jaw_per_db, 4),
        },
        "visemes": {
            name: {
                "shape": {
                    unit: round(float(weight), 3)
                    for unit, weight in zip(FACE_UNITS, viseme.shape, strict=True)
                    if round(float(weight), 3)
                },
                "dominance": {k: round(v, 3) for k, v in viseme.dominance.items()},
                "late_s": round(viseme.late_s, 4),
            }
            for name, viseme in visemes.items()
        },
    }


def from_json(plain: Mapping[str, Any]) -> tuple[dict[str, Viseme], Timing]:
    """What `as_json` wrote."""
    timing = plain["timing"]
    reach = {name: (before, after) for name, (before, after) in timing["reach_s"].items()}
    visemes = {
        name: Viseme(unit_weights(**own["shape"]), own["dominance"], own["late_s"])
        for name, own in plain["visemes"].items()
    }
    return visemes, Timing(reach, timing["plateau"], timing["jaw_per_db"])


PACKAGED = "visemes.json"
VISEMES, TIMING = from_json(json.loads((files(__package__) / PACKAGED).read_text("utf-8")))
ALIKE = {"CH": "SH", "JH": "SH", "ZH": "SH"}
DIPHTHONGS: Mapping[str, tuple[tuple[str, float], ...]] = {
    "EY": (("EH", 0.5), ("IY", 0.5)),
    "AY": (("AA", 0.55), ("IY", 0.45)),
    "OY": (("AO", 0.55), ("IY", 0.45)),
    "AW": (("AA", 0.55), ("UH", 0.45)),
    "OW": (("OW", 0.55), ("UW", 0.45)),
}


def split_diphthongs(phones: Iterable[Phone]) -> list[Phone]:
    """The same time, with every diphthong as two phones that have a viseme."""
    result: list[Phone] = []
    for name, start_s, end_s in phones:
        at_s = start_s
        for part, share in DIPHTHONGS.get(name, ((ALIKE.get(name, name), 1.0),)):
            until_s = at_s + share * (end_s - start_s)
            result.append(Phone(part, at_s, until_s))
            at_s = until_s
    return result
