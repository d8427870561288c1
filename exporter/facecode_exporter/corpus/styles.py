"""Speaking styles: what differs between the subjects of the demo corpus.

A style is to the demo model what a training identity is to CodeTalker. Each name says what one
sees; `natural` is the speaker whom the visemes were fitted to. Knows nothing of how the numbers
are used beyond their unit.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Style:
    """Gains are factors on the plain speaker; weights are of face units, 0 to 1."""

    name: str
    jaw: float = 1.0
    """gain of jaw opening"""
    lips: float = 1.0
    """gain of rounding, spreading and baring"""
    lead_s: float = 0.0
    """how much earlier than its sound a shape is reached"""
    blur: float = 0.8
    """factor on how far a phone reaches into its neighbours"""
    press: float = 1.0
    """gain of pressed lips in P, B and M; they close in every style"""
    smile: float = 0.0
    """weight held throughout"""
    frown: float = 0.0
    brow_up: float = 0.0
    brow_down: float = 0.0
    squint: float = 0.0
    brow_activity: float = 0.5
    """weight of a brow raise on the strongest stress"""
    blinks_per_s: float = 0.3
    gaze: float = 0.5
    """size of eye movements"""


STYLES: tuple[Style, ...] = (
    Style("natural"),
    Style("calm", jaw=0.8, lips=0.9, brow_activity=0.3, gaze=0.35, blinks_per_s=0.25),
    Style(
        "lively",
        jaw=1.25,
        lips=1.15,
        lead_s=0.01,
        smile=0.12,
        brow_up=0.06,
        brow_activity=0.9,
        blinks_per_s=0.4,
        gaze=0.8,
    ),
    Style(
        "mumbling",
        jaw=0.45,
        lips=0.5,
        lead_s=-0.02,
        blur=1.3,
        press=0.5,
        brow_activity=0.15,
        gaze=0.5,
    ),
    Style(
        "precise",
        jaw=1.1,
        lips=1.3,
        lead_s=0.01,
        blur=0.65,
        press=1.5,
        brow_activity=0.5,
        gaze=0.3,
        blinks_per_s=0.2,
    ),
    Style("smiling", jaw=0.95, lips=0.95, smile=0.42, squint=0.18, brow_up=0.05, brow_activity=0.5),
    Style(
        "stern",
        jaw=0.85,
        lips=0.9,
        press=1.3,
        frown=0.22,
        brow_down=0.65,
        squint=0.15,
        brow_activity=0.2,
        gaze=0.2,
        blinks_per_s=0.18,
    ),
    Style(
        "weary",
        jaw=0.65,
        lips=0.7,
        lead_s=-0.01,
        blur=1.1,
        press=0.8,
        frown=0.12,
        squint=0.25,
        brow_activity=0.2,
        blinks_per_s=0.45,
        gaze=0.4,
    ),
    Style(
        "astonished", jaw=1.1, lips=1.0, brow_up=0.55, brow_activity=0.6, gaze=0.4, blinks_per_s=0.3
    ),
)


def style_named(name: str) -> Style:
    """One of STYLES.

    Raises:
        KeyError: no such style.
    """
    return {style.name: style for style in STYLES}[name]
