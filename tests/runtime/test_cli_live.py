"""`facecode live -`: raw samples in, lines out."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import facecode
from facecode.audio import SPEECH, load_audio

LIVE = [sys.executable, "-m", "facecode.cli", "live", "-", "--threads", "1"]


@pytest.fixture(scope="module")
def pcm():
    return (load_audio(SPEECH, 16_000)[:16_000] * 32767).astype("<i2")


def test_lines_are_the_frames_of_a_stream(pcm):
    stream = facecode.load(threads=1).stream("calm", look_ahead_ms=100)
    expected = stream.feed(pcm) + stream.finish()
    done = subprocess.run(
        [*LIVE, "--style", "calm", "--look-ahead", "100"],
        input=pcm.tobytes(),
        capture_output=True,
        timeout=120,
    )
    assert done.returncode == 0
    head, *rows = [json.loads(line) for line in done.stdout.decode().splitlines()]
    assert head["names"] == list(stream.weight_names)
    assert [row["index"] for row in rows] == list(range(len(expected)))
    for row, frame in zip(rows, expected, strict=True):
        np.testing.assert_allclose(row["weights"], frame.weights, atol=1e-6)
    assert f"{len(expected)} frames, 0 left out" in done.stderr.decode()


def test_frames_come_while_the_pipe_is_open(pcm):
    process = subprocess.Popen(
        [*LIVE, "--quiet"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=False
    )
    process.stdin.write(pcm.tobytes())
    process.stdin.flush()
    lines = [process.stdout.readline() for _ in range(10)]
    assert json.loads(lines[-1])["index"] == 8
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    assert process.wait(10) == 130
    assert time.monotonic() - start < 2
    process.stdin.close()
    process.stdout.close()


def test_a_reader_that_goes_away(pcm):
    read, write = os.pipe()
    process = subprocess.Popen(
        [*LIVE, "--quiet"], stdin=subprocess.PIPE, stdout=write, stderr=subprocess.PIPE
    )
    os.close(write)
    os.close(read)
    _, errors = process.communicate(pcm.tobytes(), timeout=60)
    assert process.returncode == 2
    assert b"Traceback" not in errors


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--udp", "nohost.invalid:5"], "HOST:PORT"),
        (["--udp", "nowhere"], "HOST:PORT"),
        (["--look-ahead", "5"], "look-ahead"),
        (["--style", "clam"], "clam"),
        (["--rate", "0"], "positive"),
    ],
)
def test_mistakes(options, says, run_cli):
    done = run_cli("live", "-", *options)
    assert done.returncode == 2
    assert says in done.stderr
