"""A server in a thread of the test, and clients for it."""

from __future__ import annotations

import json
import threading
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from facecode.serve.access import Access
from facecode.serve.app import build_app
from facecode.serve.heads import Heads
from facecode.serve.house import House
from facecode.serve.limits import Limits
from facecode.serve.server import listen, server_of

K = 52


@dataclass
class Running:
    """A server that listens."""

    port: int
    house: House

    @property
    def metrics(self):
        return self.house.metrics

    def connect(self, **options):
        options = {"compression": None, "max_size": None} | options
        return connect(f"ws://127.0.0.1:{self.port}/stream", **options)

    def get(self, path, **headers):
        """Status, headers and body."""
        request = urllib.request.Request(f"http://127.0.0.1:{self.port}/{path}", headers=headers)
        try:
            with urllib.request.urlopen(request, timeout=20) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as error:
            return error.code, error.headers, error.read()

    def ended(self, *reasons, n=1, timeout_s=20.0):
        """Wait until `n` connections have ended in one of these ways."""
        until = time.monotonic() + timeout_s
        while sum(self.metrics.ended[reason] for reason in reasons) < n:
            assert time.monotonic() < until, dict(self.metrics.ended)
            time.sleep(0.02)


@contextmanager
def running(face, access=None, workers=2, **limits):
    """A server of `face`, stopped in the end."""
    limits = Limits(**{"sessions": 4} | limits)
    house = House(face, limits, workers)
    access = access or Access()
    listening = listen("127.0.0.1", 0)
    port = listening.getsockname()[1]
    server = server_of(build_app(house, Heads(face), access), limits)
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    try:
        yield Running(port, house)
    finally:
        server.should_exit = True
        thread.join(20)
        assert not thread.is_alive()


@dataclass
class Got:
    """All that a session was sent."""

    indices: list = field(default_factory=list)
    times: list = field(default_factory=list)
    weights: np.ndarray | None = None
    messages: list = field(default_factory=list)
    code: int | None = None

    def told(self, kind):
        return [m for m in self.messages if m["type"] == kind]

    @property
    def end(self):
        return self.told("end")[0]["reason"]


def opening(rate, **fields):
    return json.dumps({"sample_rate": rate, **fields})


def collect(socket):
    """Read until the server closes."""
    got, rows = Got(), []
    try:
        while True:
            data = socket.recv(60)
            if isinstance(data, str):
                got.messages.append(json.loads(data))
            else:
                rows.append(np.frombuffer(data, "<f4").reshape(-1, 2 + K))
    except ConnectionClosed:
        pass
    frames = np.concatenate(rows) if rows else np.empty((0, 2 + K), "<f4")
    got.indices = np.ascontiguousarray(frames[:, 0]).view("<u4").tolist()
    got.times, got.weights, got.code = frames[:, 1].tolist(), frames[:, 2:], socket.close_code
    return got


def talk(running, messages, **options):
    """Send messages from a thread of their own, so that reading holds up nothing; what comes."""
    with running.connect(**options) as socket:

        def send():
            try:
                for each in messages:
                    socket.send(each)
            except ConnectionClosed:
                pass

        thread = threading.Thread(target=send)
        thread.start()
        got = collect(socket)
        thread.join(20)
    return got


def chunks(samples, length):
    return [samples[i : i + length].tobytes() for i in range(0, len(samples), length)]


FINISH = '{"type":"finish"}'
