"""The messages of a session, as docs/serve.md describes them. Knows no socket."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from facecode.live.frame import LiveFrame
from facecode.options import Style
from facecode.serve.errors import ProtocolError

PROTOCOL = 1
BLEND_S = 0.3
LONGEST_BLEND_S = 10.0
BYTES_PER_SAMPLE = 2

Samples16: TypeAlias = NDArray[np.int16]


@dataclass(frozen=True)
class Opening:
    """The first message of a client."""

    sample_rate: int
    """Of the speech to come, Hz."""
    style: Style | None = None
    """None: the bundle's first."""
    look_ahead_ms: float | None = None
    live: bool = True
    """Whether the speech comes as it is spoken, so that it is better skipped than heard late."""
    rest_in_quiet: bool = False
    token: str = ""


@dataclass(frozen=True)
class Command:
    """A message of a client between its speech."""

    type: Literal["style", "flush", "reset", "finish"]
    style: Style = ""
    """With `style` alone, as is the next."""
    blend_s: float = BLEND_S


def parse_opening(text: str | None) -> Opening:
    """The first message.

    Raises:
        ProtocolError
    """
    if text is None:
        raise ProtocolError('got speech first; expected JSON such as {"sample_rate": 48000}')
    fields = _object(text)
    _refuse_others(fields, set(Opening.__dataclass_fields__))
    if "sample_rate" not in fields:
        raise ProtocolError('expected "sample_rate", the samples of the speech in a second')
    rate = _number(fields, "sample_rate")
    if rate != int(rate):
        raise ProtocolError(f'got "sample_rate" {rate}; expected a whole number')
    token = fields.get("token", "")
    if not isinstance(token, str):
        raise ProtocolError('"token" is a text')
    ahead = _number(fields, "look_ahead_ms") if "look_ahead_ms" in fields else None
    style = _style(fields["style"]) if "style" in fields else None
    live, rest = _truth(fields, "live", True), _truth(fields, "rest_in_quiet", False)
    return Opening(int(rate), style, ahead, live, rest, token)


def parse_command(text: str) -> Command:
    """A message between the speech.

    Raises:
        ProtocolError
    """
    fields = _object(text)
    kind = fields.get("type")
    if kind == "style":
        _refuse_others(fields, {"type", "style", "blend_s"})
        blend_s = _number(fields, "blend_s") if "blend_s" in fields else BLEND_S
        if not 0 <= blend_s <= LONGEST_BLEND_S:
            raise ProtocolError(f'got "blend_s" {blend_s}; expected 0 to {LONGEST_BLEND_S:g}')
        return Command("style", _style(fields.get("style")), blend_s)
    if kind in ("flush", "reset", "finish"):
        _refuse_others(fields, {"type"})
        return Command(kind)
    raise ProtocolError('expected "type": "style", "flush", "reset" or "finish"')


def parse_samples(data: bytes) -> Samples16:
    """Speech (n,), little-endian.

    Raises:
        ProtocolError: half a sample.
    """
    if len(data) % BYTES_PER_SAMPLE:
        raise ProtocolError(f"got {len(data)} bytes; expected samples of 16 bits, an even number")
    return np.frombuffer(data, "<i2")


def pack_frames(frames: Sequence[LiveFrame]) -> bytes:
    """Frames one after the other, each `uint32 index, float32 time_s, float32 weights[K]`."""
    known = [frame.weights for frame in frames if frame.weights is not None]
    rows = np.empty((len(frames), 2 + known[0].shape[0]), "<f4")
    rows.view("<u4")[:, 0] = [frame.index for frame in frames]
    rows[:, 1] = [frame.time_s for frame in frames]
    rows[:, 2:] = known
    return rows.tobytes()


def message(kind: str, **fields: Any) -> str:  # noqa: ANN401
    """A message of the server."""
    return json.dumps({"type": kind, **fields})


def _object(text: str) -> Mapping[str, Any]:
    try:
        fields = json.loads(text, parse_constant=_refuse_constant)
    except (ValueError, RecursionError):
        fields = None
    if not isinstance(fields, dict):
        raise ProtocolError(f"got {text[:40]!r}; expected a JSON object")
    return fields


def _refuse_constant(name: str) -> None:
    raise ValueError(name)


def _refuse_others(fields: Mapping[str, Any], known: set[str]) -> None:
    if others := sorted(fields.keys() - known):
        raise ProtocolError(f"got {others[0][:40]!r}; expected {', '.join(sorted(known))}")


def _number(fields: Mapping[str, Any], name: str) -> float:
    value = fields[name]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > 1e9:
        raise ProtocolError(f'"{name}" is a number')
    return float(value)


def _truth(fields: Mapping[str, Any], name: str, default: bool) -> bool:
    value = fields.get(name, default)
    if not isinstance(value, bool):
        raise ProtocolError(f'"{name}" is true or false')
    return value


def _style(value: Any) -> Style:  # noqa: ANN401
    if isinstance(value, str):
        return value
    if isinstance(value, dict) and value:
        return {name: _number(value, name) for name in value}
    raise ProtocolError('"style" is a name, or a mix such as {"calm": 0.3, "lively": 0.7}')
