"""Messages of a session: what is understood, what is refused, and how frames are packed."""

import json
import struct

import numpy as np
import pytest

from facecode.live.frame import LiveFrame
from facecode.serve.errors import ProtocolError
from facecode.serve.protocol import (
    Command,
    Opening,
    pack_frames,
    parse_command,
    parse_opening,
    parse_samples,
)


def test_openings():
    assert parse_opening('{"sample_rate": 48000}') == Opening(48000)
    asked = {
        "sample_rate": 16000.0,
        "style": {"calm": 0.5, "lively": 0.5},
        "look_ahead_ms": 100,
        "live": False,
        "rest_in_quiet": True,
        "token": "x",
    }
    found = parse_opening(json.dumps(asked))
    assert found == Opening(16000, {"calm": 0.5, "lively": 0.5}, 100.0, False, True, "x")


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "speech first"),
        ("", "JSON object"),
        ("[1]", "JSON object"),
        ("[" * 100_000, "JSON object"),
        ('{"sample_rate": NaN}', "JSON object"),
        ("{}", "sample_rate"),
        ('{"sample_rate": "48000"}', "number"),
        ('{"sample_rate": true}', "number"),
        ('{"sample_rate": 1e99}', "number"),
        ('{"sample_rate": 44100.5}', "whole"),
        ('{"sample_rate": 48000, "live": 1}', "true or false"),
        ('{"sample_rate": 48000, "token": 1}', "text"),
        ('{"sample_rate": 48000, "style": 3}', "style"),
        ('{"sample_rate": 48000, "style": {}}', "style"),
        ('{"sample_rate": 48000, "style": {"calm": "much"}}', "number"),
        ('{"sample_rate": 48000, "rate": 3}', "'rate'; expected live"),
    ],
)
def test_openings_without_meaning(text, why):
    with pytest.raises(ProtocolError, match=why):
        parse_opening(text)


def test_commands():
    assert parse_command('{"type": "flush"}') == Command("flush")
    assert parse_command('{"type": "style", "style": "calm"}') == Command("style", "calm", 0.3)
    found = parse_command('{"type": "style", "style": "calm", "blend_s": 0}')
    assert found == Command("style", "calm", 0.0)


@pytest.mark.parametrize(
    "text",
    [
        '{"type": "stop"}',
        '{"type": ["flush"]}',
        '{"type": "flush", "style": "calm"}',
        '{"type": "style"}',
        '{"type": "style", "style": "calm", "blend_s": -1}',
        '{"type": "style", "style": "calm", "blend_s": 11}',
        "flush",
    ],
)
def test_commands_without_meaning(text):
    with pytest.raises(ProtocolError, match=r"expected|style|JSON"):
        parse_command(text)


def test_samples():
    assert parse_samples(b"\x01\x00\xff\xff").tolist() == [1, -1]
    with pytest.raises(ProtocolError, match="even"):
        parse_samples(b"\x01\x00\xff")


def test_frames_are_packed_as_the_document_says():
    frames = [
        LiveFrame(index, index / 30, np.zeros(1, np.int64), np.float32([0.25, 1]), None)
        for index in (7, 2**24 + 1)
    ]
    packed = pack_frames(frames)
    assert struct.unpack("<Ifff", packed[:16]) == (7, np.float32(7 / 30), 0.25, 1.0)
    assert struct.unpack("<I", packed[16:20]) == (2**24 + 1,)
