"""Where the frames of a stream go: lines of JSON, Live Link Face's packets, VMC's messages."""

from __future__ import annotations

import json
import socket
import struct
import uuid
from collections.abc import Callable
from typing import TextIO, TypeAlias

import numpy as np

from facecode.arrays import Float32
from facecode.errors import AddressError, MissingExtraError
from facecode.live.frame import LiveFrame
from facecode.live.stream import Stream
from facecode.writers.arkit import NAMES, columns, in_order, pascal

Sink: TypeAlias = "Callable[[LiveFrame, Float32], None]"
"""Takes a frame, and its weights (K,)."""

_SWAPPED = {"jawRight": "jawLeft", "mouthRight": "mouthLeft"}
_OTHERS = _SWAPPED | {left: right for right, left in _SWAPPED.items()}
PACKET_NAMES = tuple(_OTHERS.get(name, name) for name in NAMES)
"""The order of a packet: left before right in jaw and mouth, unlike the app's own .csv."""
N_ROTATIONS = 9
PACKET_VERSION = 6
SUBJECT = "facecode"
DECIMALS = 6


def json_lines(stream: Stream, file: TextIO) -> Sink:
    """A line for the names of the weights, and one for each frame; written through at once."""

    def write(plain: object) -> None:
        file.write(json.dumps(plain, separators=(",", ":")) + "\n")
        file.flush()

    write(
        {
            "fps": stream.plan.fps,
            "latency_ms": round(stream.latency_ms, 1),
            "names": stream.weight_names,
        }
    )

    def sink(frame: LiveFrame, weights: Float32) -> None:
        rounded = [round(float(weight), DECIMALS) for weight in weights]
        time_s = round(frame.time_s, DECIMALS)
        write({"index": frame.index, "time_s": time_s, "weights": rounded})

    return sink


def live_link(stream: Stream, address: tuple[str, int]) -> Sink:
    """UDP packets as the app Live Link Face sends them to Unreal, one a frame.

    Version, device and subject name, frame time, and 61 big-endian floats: ARKit's 52 units and
    nine rotations of head and eyes, which are 0.

    Raises:
        UnitNamesError: the rig has no unit of ARKit's.
        AddressError: no such host.
    """
    in_rig = dict(zip(NAMES, columns(stream.weight_names, "Live Link Face"), strict=True))
    found = [in_rig[name] for name in PACKET_NAMES]
    target, wire = _opened(address)
    device = str(uuid.uuid4()).encode()
    fps = round(stream.plan.fps)
    head = struct.pack("!Bi", PACKET_VERSION, len(device)) + device
    head += struct.pack("!i", len(SUBJECT)) + SUBJECT.encode()
    n_values = len(NAMES) + N_ROTATIONS

    def sink(frame: LiveFrame, weights: Float32) -> None:
        values = np.zeros(n_values, ">f4")
        values[: len(NAMES)] = in_order(weights[None], found)[0]
        time = struct.pack("!ifiiB", frame.index, 0.0, fps, 1, n_values)
        wire.sendto(head + time + values.tobytes(), target)

    return sink


def vmc(stream: Stream, address: tuple[str, int]) -> Sink:
    """OSC messages of the Virtual Motion Capture protocol, a bundle a frame.

    `/VMC/Ext/Blend/Val` for each unit, under the names of Perfect Sync, and `/VMC/Ext/Blend/Apply`.

    Raises:
        MissingExtraError: python-osc is not installed.
        AddressError: no such host.
    """
    try:
        from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
        from pythonosc.osc_message_builder import OscMessageBuilder
    except ImportError as error:
        raise MissingExtraError.of("--osc", "python-osc", "live") from error
    target, wire = _opened(address)
    names = [pascal(name) for name in stream.weight_names]

    def sink(frame: LiveFrame, weights: Float32) -> None:
        bundle = OscBundleBuilder(IMMEDIATELY)

        def add(where: str, *values: object) -> None:
            message = OscMessageBuilder(where)
            for value in values:
                message.add_arg(value)
            bundle.add_content(message.build())

        add("/VMC/Ext/OK", 1)
        add("/VMC/Ext/T", float(frame.time_s))
        for name, weight in zip(names, weights, strict=True):
            add("/VMC/Ext/Blend/Val", name, float(weight))
        add("/VMC/Ext/Blend/Apply")
        wire.sendto(bundle.build().dgram, target)

    return sink


def _opened(address: tuple[str, int]) -> tuple[tuple[str, int], socket.socket]:
    host, port = address
    try:
        family, kind, _, _, found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        return (str(found[0]), port), socket.socket(family, kind)
    except OSError as error:
        raise AddressError(f"cannot send to {host}:{port}: {error}; give HOST:PORT") from error
