"""`facecode serve` as a process: it says where it is, ends, comes back, and says what is wrong."""

import os
import signal
import subprocess
import sys
import time

import pytest
from serving import FINISH, Running, opening, talk


def start(*args, env=None):
    """The process, and the first line that it says."""
    process = subprocess.Popen(
        [sys.executable, "-m", "facecode.cli", "serve", *args],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **(env or {})},
    )
    return process, process.stdout.readline().strip()


def port_of(line):
    return int(line.partition("#")[0].rstrip("/").rpartition(":")[2])


def spoken(port, **fields):
    messages = [opening(16000, live=False, **fields), bytes(16000), FINISH]
    return talk(Running(port, None), messages)


def test_killed_and_back_again():
    process, line = start("--port", "0")
    port = port_of(line)
    assert len(spoken(port).indices) == 15
    process.kill()
    process.communicate(timeout=20)
    again, line = start("--port", str(port))
    try:
        assert port_of(line) == port
        assert len(spoken(port).indices) == 15
    finally:
        again.send_signal(signal.SIGTERM)
        _, said = again.communicate(timeout=20)
    assert again.returncode == 143
    assert "Traceback" not in said


def test_interrupted_with_a_client():
    process, line = start("--port", "0", "--sessions", "1", env={"FACECODE_TOKEN": "s3cret"})
    assert line.endswith("#token=...")
    with Running(port_of(line), None).connect() as ws:
        ws.send(opening(16000, token="s3cret"))
        ws.recv(20)
        began = time.monotonic()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=20)
    assert time.monotonic() - began < 8
    assert process.returncode == 130
    assert "Traceback" not in said
    assert "s3cret" not in line + said


@pytest.mark.parametrize(
    ("args", "why"),
    [
        (["--port", "99999"], "cannot listen"),
        (["--origin", "example.com"], "expected one as https://example.com"),
        (["--bundle", "/nowhere"], "no bundle"),
        (["--sessions", "0"], "positive"),
    ],
)
def test_mistakes(run_cli, args, why):
    done = run_cli("serve", *args)
    assert done.returncode == 2
    assert why in done.stderr
    assert "Traceback" not in done.stderr


def test_without_the_extra(tmp_path):
    (tmp_path / "starlette.py").write_text("raise ModuleNotFoundError(name='starlette')")
    paths = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-m", "facecode.cli", "serve"],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2
    assert "pip install '.[serve]'" in done.stderr
