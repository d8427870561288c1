"""What a caller asks for beside the speech, checked: style, mode, samples, codes to hold."""

from __future__ import annotations

import difflib
import math
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from facecode.arrays import AnyArray, Codes, Float32
from facecode.clip import Clip
from facecode.errors import ModeError, NoRigError, SampleError, StyleError, StyleWarning
from facecode.loop.codes import check_codes
from facecode.loop.part import Part
from facecode.options import MODES, Held, Samples, Style
from facecode_spec.manifest import ModeEntry


@dataclass(frozen=True)
class Window:
    """How `window` mode decodes."""

    frames: int
    """Decoded at a step."""
    delay: int
    """Frames that follow a frame before it is final."""


@dataclass(frozen=True)
class Request:
    """What to generate beside the speech; see `Engine.request`."""

    weights: Float32
    """Of the styles, (n_styles,), or (n_clips, n_styles)."""
    heads: Mapping[str, AnyArray]
    """Head index (rows of a clip,) int64 of every batch row, for each generated part."""
    window: Window | None = None
    """None: `exact`, the whole prefix."""
    hold: Mapping[str, Codes] = field(default_factory=dict)
    """Codes (T, H) of the parts that are not generated."""
    vertices: bool = True
    """False: weights of face units alone."""
    progress: bool = False


def request_of(
    parts: Sequence[Part],
    weights: Float32 | None,
    window: Window | None,
    samples: Samples | None,
    hold: Held | None,
    vertices: bool,
    progress: bool,
) -> Request:
    """What to generate, checked against the parts.

    Args:
        parts: of the face.
        weights: of the styles, (n_styles,), or (n_clips, n_styles); the first style by default.
        window: None for `exact`.
        samples: see `Animator.animate`.
        hold: codes (T, H), or a clip, by part name.
        vertices: False for products with the deltas of the rig in place of offsets.
        progress: show a bar on stderr.

    Raises:
        SampleError, CodesError.
        NoRigError: no vertices, and a bundle without a rig.
        ModeError: a part to hold that there is not.
    """
    if weights is None:
        weights = np.eye(1, parts[0].n_styles, dtype=np.float32)[0]
    held = {name: _held(parts, name, kept) for name, kept in (hold or {}).items()}
    heads = sample_heads(samples, parts, held)
    if not vertices and any(part.rig_projection is None for part in parts):
        raise NoRigError(
            "weights without vertices need a bundle with face units: export it with --units "
            "FILE.npz, or leave vertices=False out"
        )
    return Request(weights, heads, window, held, vertices, progress)


def _held(parts: Sequence[Part], name: str, kept: AnyArray | Clip) -> Codes:
    part = {p.name: p for p in parts}.get(name)
    if part is None:
        names = ", ".join(p.name for p in parts)
        raise ModeError(f"got {name!r} to hold; expected one of {names}")
    return check_codes(kept.codes_of(name) if isinstance(kept, Clip) else kept, part)


def refuse_unknown(function: str, options: Collection[str], known: type) -> None:
    """Refuse keyword arguments that `known`, a TypedDict, does not name.

    Raises:
        TypeError
    """
    names = sorted(known.__annotations__)
    if unknown := sorted(set(options) - set(names)):
        raise TypeError(
            f"{function}() got an unexpected argument {unknown[0]!r}; it takes {', '.join(names)}"
        )


def window_of(
    mode: str | None, frames: int | None, modes: Mapping[str, ModeEntry], smallest: int
) -> Window | None:
    """How to decode in `mode`; None for `exact`.

    Args:
        mode: `exact` by default.
        frames: decoded at a step in `window` mode; by default the bundle's choice.
        modes: of the bundle.
        smallest: the fewest frames that a step can decode.

    Raises:
        ModeError: unknown mode, `frames` without window mode, or too few.
    """
    mode = "exact" if mode is None else mode
    if mode in MODES and list(modes) == ["exact"] != [mode]:
        raise ModeError(
            f"got mode {mode!r}; this bundle has one mode for recordings, exact: leave mode and "
            "window out"
        )
    if mode not in modes or mode not in MODES:
        raise ModeError(f"got mode {mode!r}; expected one of {', '.join(modes)}")
    if mode == "exact":
        if frames is not None:
            raise ModeError("a window goes with mode 'window'; exact decodes the whole prefix")
        return None
    if frames is not None and frames < smallest:
        raise ModeError(
            f"got a window of {frames} frames; expected at least {smallest}, since the "
            f"newest frame changes {smallest - 1} before it"
        )
    entry = modes[mode]
    return Window(frames or entry.window or smallest, entry.delay_frames or 0)


def style_weights(style: Style | None, names: Sequence[str]) -> Float32:
    """Weights (n_styles,) float32 of a style; the first one when `style` is None.

    A mix is the weighted sum of the styles' vectors, weights as given.

    Raises:
        StyleError: unknown name, empty mix, or a weight that is not a finite number.
    """
    if style is None:
        style = names[0]
    mix = {style: 1.0} if isinstance(style, str) else dict(style)
    if not mix:
        raise StyleError(f"the style mix is empty; choose from {', '.join(names)}")
    weights = np.zeros(len(names), dtype=np.float32)
    for name, weight in mix.items():
        if name not in names:
            raise StyleError(_unknown_style(name, names))
        if not isinstance(weight, (int, float)) or not math.isfinite(weight):
            raise StyleError(f"style {name!r} has the weight {weight!r}; expected a finite number")
        weights[names.index(name)] = weight
    total = sum(mix.values())
    if abs(total - 1) > 1e-3:
        warnings.warn(
            f"the style weights sum to {total:g}, not 1; the mix is used as given",
            StyleWarning,
            stacklevel=4,
        )
    return weights


def _unknown_style(name: str, names: Sequence[str]) -> str:
    by_case = {known.casefold(): known for known in names}
    near = difflib.get_close_matches(name.casefold(), by_case, n=3, cutoff=0.4)
    nearest = f"; nearest: {', '.join(by_case[n] for n in near)}" if near else ""
    return f"no style {name!r}{nearest}. This bundle has {', '.join(names)}"


def sample_heads(
    samples: Samples | None, parts: Sequence[Part], held: Collection[str] = ()
) -> dict[str, AnyArray]:
    """Head index of every batch row of a clip, (rows,) int64, for each part that is not held.

    K faces are K samples of the first part that gives several, each continued by the sample of the
    same number of every later part. Numbers by part combine each sample of a part with each of
    the part before. None is the first sample of every part.

    Raises:
        SampleError: a part that is unknown or held, fewer than one, or more than it has heads.
    """
    free = [part for part in parts if part.name not in held]
    if isinstance(samples, Mapping):
        return _combined(samples, free)
    heads = {part.name: np.zeros(1, np.int64) for part in free}
    if samples is None:
        return heads
    names = [part.name for part in free]
    first = next((i for i, part in enumerate(free) if part.n_samples > 1), 0)
    _check_count(samples, free, names[first] if names else "")
    for part in free[first:]:
        heads[part.name] = np.arange(samples) % part.n_samples
    return heads


def _combined(counts: Mapping[str, int], free: Sequence[Part]) -> dict[str, AnyArray]:
    heads, rows = {}, 1
    for name, n in counts.items():
        _check_count(n, free, name)
    for part in free:
        n = counts.get(part.name, 1)
        heads[part.name] = np.tile(np.arange(n), rows)
        rows *= n
    return heads


def _check_count(n: int, free: Sequence[Part], name: str) -> None:
    can = {part.name: part.n_samples for part in free}
    if name not in can:
        raise SampleError(
            f"got samples of {name or 'nothing'}; the parts that can vary are "
            f"{', '.join(can) or 'none'}"
        )
    if not 1 <= n <= can[name]:
        gives = ", ".join(f"{part} {k}" for part, k in can.items())
        more = "" if max(can.values()) > 1 else ". The packaged bundle 'diverse' gives 5"
        raise SampleError(
            f"got {n} samples of {name}; expected 1 to {can[name]} (this bundle gives: {gives})"
            f"{more}"
        )
