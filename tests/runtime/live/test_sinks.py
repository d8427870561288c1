"""Frames on their way out, read by programs that are not ours where there are any."""

import io
import json
import socket
import struct
import threading
import time

import numpy as np
import pytest
from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import ThreadingOSCUDPServer

import facecode
from facecode.errors import AddressError
from facecode.live.sinks import PACKET_NAMES, json_lines, live_link, vmc
from facecode.writers.arkit import NAMES


@pytest.fixture(scope="module")
def stream():
    return facecode.load(threads=1).stream()


@pytest.fixture(scope="module")
def frames(stream):
    rng = np.random.default_rng(0)
    waveform = 0.1 * rng.standard_normal(16_000, np.float32)
    return stream.feed(waveform)[:5]


def test_json_lines(stream, frames):
    file = io.StringIO()
    sink = json_lines(stream, file)
    for frame in frames:
        sink(frame, frame.weights)
    head, *rows = [json.loads(line) for line in file.getvalue().splitlines()]
    assert head["names"] == list(stream.weight_names)
    assert head["fps"] == 30
    assert head["latency_ms"] == pytest.approx(stream.latency_ms, abs=0.1)
    for row, frame in zip(rows, frames, strict=True):
        assert row["index"] == frame.index
        assert row["time_s"] == pytest.approx(frame.time_s, abs=1e-6)
        np.testing.assert_allclose(row["weights"], frame.weights, atol=1e-6)


def test_live_link_packets(stream, frames):
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.bind(("127.0.0.1", 0))
    receiver.settimeout(10)
    sink = live_link(stream, receiver.getsockname())
    for frame in frames:
        sink(frame, frame.weights)
        packet = receiver.recv(4096)
        version, n_device = struct.unpack_from("!Bi", packet)
        n_subject = struct.unpack_from("!i", packet, 5 + n_device)[0]
        at = 9 + n_device
        assert version == 6
        assert packet[at : at + n_subject] == b"facecode"
        index, part, fps, base, n = struct.unpack_from("!ifiiB", packet, at + n_subject)
        assert (index, part, fps, base, n) == (frame.index, 0.0, 30, 1, 61)
        values = np.frombuffer(packet, ">f4", offset=at + n_subject + 17)
        wanted = [frame.weights[stream.weight_names.index(name)] for name in PACKET_NAMES]
        assert np.array_equal(values, np.float32([*wanted, *[0] * 9]))


def test_packets_have_left_before_right_where_files_do_not():
    """As Unreal's ARKit enumeration, and PyLiveLinkFace, have it."""
    assert sorted(PACKET_NAMES) == sorted(NAMES)
    assert PACKET_NAMES[14:18] == ("jawForward", "jawLeft", "jawRight", "jawOpen")
    assert PACKET_NAMES[20:23] == ("mouthPucker", "mouthLeft", "mouthRight")


def test_vmc_messages(stream, frames):
    heard, dispatcher = [], Dispatcher()
    dispatcher.set_default_handler(lambda address, *values: heard.append((address, *values)))
    server = ThreadingOSCUDPServer(("127.0.0.1", 0), dispatcher)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    sink = vmc(stream, server.server_address)
    sink(frames[0], frames[0].weights)
    end = time.monotonic() + 10
    while len(heard) < 55 and time.monotonic() < end:
        time.sleep(0.01)
    server.shutdown()
    assert [h for h in heard if h[0] == "/VMC/Ext/Blend/Apply"] == [("/VMC/Ext/Blend/Apply",)]
    values = {h[1]: h[2] for h in heard if h[0] == "/VMC/Ext/Blend/Val"}
    for name, weight in zip(stream.weight_names, frames[0].weights, strict=True):
        assert values[name[0].upper() + name[1:]] == pytest.approx(float(weight), abs=1e-6)


def test_no_such_host(stream):
    with pytest.raises(AddressError, match="HOST:PORT"):
        live_link(stream, ("nohost.invalid", 1))
