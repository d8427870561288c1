"""Sessions over real sockets: the same frames as a stream, and what ends or refuses one."""

import json
import socket
import threading
import time
from contextlib import contextmanager, suppress

import numpy as np
import pytest
import soundfile
from conftest import SPEECH
from serving import FINISH, ConnectionClosed, Running, chunks, collect, opening, running, talk
from websockets.exceptions import InvalidStatus

import facecode
from facecode.serve import app, session
from facecode.serve.access import Access

RATE = 16000


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def served(face):
    with running(face) as server:
        yield server


@pytest.fixture(scope="module")
def speech():
    samples, rate = soundfile.read(SPEECH, dtype="int16")
    assert rate == RATE
    return samples[: 4 * RATE]


@pytest.fixture(scope="module")
def expected(face, speech):
    """Weights of a stream without a server."""
    stream = face.stream()
    frames = stream.feed(speech, RATE) + stream.finish()
    return np.stack([frame.weights for frame in frames])


def recording(speech, length=RATE // 4, **fields):
    return [opening(RATE, live=False, **fields), *chunks(speech, length), FINISH]


@pytest.mark.parametrize("length", [RATE // 50, 777, 4 * RATE])
def test_frames_are_those_of_a_stream_to_the_bit(served, speech, expected, length):
    got = talk(served, recording(speech, length))
    assert np.array_equal(got.weights, expected)
    assert got.indices == list(range(len(expected)))
    assert got.times == pytest.approx(np.arange(len(expected)) / 30)
    assert got.told("finish_done") == [
        {"type": "finish_done", "next_frame": len(expected), "skipped": 0}
    ]
    assert got.code == 1000
    ready = got.messages[0]
    assert (ready["type"], ready["protocol"], ready["fps"]) == ("ready", 1, 30.0)
    assert ready["latency_ms"] == pytest.approx(1000 / 3)
    assert len(ready["weight_names"]) == 52
    assert "jawOpen" in ready["weight_names"]


def test_three_clients_at_once_get_what_one_gets(served, speech, expected):
    got = {}
    threads = [
        threading.Thread(target=lambda k=k: got.update({k: talk(served, recording(speech))}))
        for k in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    assert [np.array_equal(got[k].weights, expected) for k in range(3)] == [True] * 3


def test_styles_pauses_and_new_beginnings(face, served, speech):
    stream = face.stream("calm", look_ahead_ms=100)
    wanted = stream.feed(speech[:RATE], RATE)
    stream.restyle("lively", 0.2)
    wanted += stream.feed(speech[RATE : 2 * RATE + 99]) + stream.flush()
    stream.reset()
    wanted += stream.feed(speech[RATE:], RATE) + stream.finish()
    restyle = json.dumps({"type": "style", "style": "lively", "blend_s": 0.2})
    with served.connect() as ws:
        ws.send(opening(RATE, live=False, style="calm", look_ahead_ms=100))
        for each in (*chunks(speech[:RATE], 3000), restyle):
            ws.send(each)
        for each in (*chunks(speech[RATE : 2 * RATE + 99], 3000), '{"type":"flush"}'):
            ws.send(each)
        messages = []
        while not messages or "flush_done" not in str(messages[-1]):  # reset forgets what waits
            messages.append(ws.recv(20))
        for each in ('{"type":"reset"}', *chunks(speech[RATE:], 3000), FINISH):
            ws.send(each)
        late = collect(ws)
    rows = [np.frombuffer(m, "<f4").reshape(-1, 54) for m in messages if isinstance(m, bytes)]
    weights = np.concatenate([*(row[:, 2:] for row in rows), late.weights])
    assert np.array_equal(weights, np.stack([frame.weights for frame in wanted]))
    assert late.indices[0] == 0
    assert json.loads(messages[-1])["next_frame"] == sum(map(len, rows))
    assert late.told("reset_done")


def test_live_speech_that_waits_is_skipped_and_counted(face, served, speech, expected):
    before = served.metrics.skipped_frames
    with served.connect() as ws:
        ws.send(opening(RATE))
        json.loads(ws.recv(20))
        for each in chunks(speech, RATE // 2):
            ws.send(each)
        ws.send(FINISH)
        got = collect(ws)
    skipped = got.told("finish_done")[0]["skipped"]
    assert skipped > 30
    assert got.told("skipped")[-1]["frames"] == skipped
    assert len(got.indices) + skipped == len(expected)
    assert len(got.indices) < got.indices[-1] + 1
    assert served.metrics.skipped_frames - before == skipped


def test_live_speech_in_step_is_not_skipped(served, speech):
    with served.connect() as ws:
        ws.send(opening(RATE))
        ws.recv(20)

        def send():
            start = time.monotonic()
            for i, each in enumerate(chunks(speech[: 2 * RATE], RATE // 50)):
                time.sleep(max(0, start + i / 50 - time.monotonic()))
                ws.send(each)
            ws.send(FINISH)

        thread = threading.Thread(target=send)
        thread.start()
        got = collect(ws)
        thread.join(20)
    assert got.indices[-1] == 59
    assert sorted(got.indices) == got.indices


@pytest.mark.parametrize(
    "messages",
    [
        [b"\x00" * 100],
        ["hello"],
        [opening(RATE), b"\x00" * 101],
        [opening(RATE), "hello"],
        [opening(RATE), '{"type":"explode"}'],
        [opening(RATE, style="nobody")],
        [opening(RATE), '{"type":"style","style":"nobody"}'],
        [opening(7)],
        [opening(RATE, look_ahead_ms=5)],
        [opening(RATE), '{"type":"finish"}{"type":"finish"}'],
    ],
    ids=range(10),
)
def test_rubbish_ends_a_session_with_a_reason(served, messages):
    got = talk(served, messages)
    assert (got.end, got.code) == ("rubbish", 1007)
    assert len(got.told("end")[0]["message"]) > 10


def test_text_that_is_no_text(served):
    with served.connect() as ws:
        ws.send(opening(RATE))
        ws.recv(20)
        ws.send(b"\xff\xfe\xfd", text=True)
        assert collect(ws).code == 1007


def test_messages_of_10_mb_are_not_read(served):
    """The client, which is still sending, may learn of a closed connection alone."""
    for big in (bytes(10_000_000), "x" * 10_000_000):
        with served.connect(close_timeout=1) as ws:
            ws.send(opening(RATE))
            ws.recv(20)
            with suppress(ConnectionClosed):
                ws.send(big)
            assert collect(ws).code in (1006, 1009)
    served.ended("too_big", n=2)


def test_one_more_is_busy_and_a_place_comes_back(face):
    with running(face, sessions=1) as server:
        with server.connect() as first:
            first.send(opening(RATE))
            first.recv(20)
            assert server.metrics.sessions == 1
            got = talk(server, [opening(RATE)])
            assert (got.end, got.code) == ("busy", 1013)
        server.ended("left")
        with server.connect() as again:
            again.send(opening(RATE))
            assert json.loads(again.recv(20))["type"] == "ready"


def test_who_says_nothing_is_let_go(face, monkeypatch):
    monkeypatch.setattr(app, "OPENING_S", 0.2)
    with running(face, idle_s=0.3, seconds=1.5) as server:
        assert talk(server, []).end == "idle"
        assert talk(server, [opening(RATE)]).end == "idle"
        with server.connect() as ws:
            ws.send(opening(RATE))
            for _ in range(40):
                try:
                    ws.send(bytes(320))
                except ConnectionClosed:
                    break
                time.sleep(0.1)
            got = collect(ws)
            assert (got.end, got.code) == ("too_long", 1008)


def test_doorsteps_are_few(face, monkeypatch):
    from facecode.serve import house

    monkeypatch.setattr(house, "UNOPENED", 2)
    with running(face) as server:
        with server.connect(), server.connect():
            assert talk(server, []).end == "busy"
        server.ended("left", n=2)
        with server.connect() as ws:
            ws.send(opening(RATE))
            assert json.loads(ws.recv(20))["type"] == "ready"


def test_tokens(face, speech, expected):
    with running(face, Access(token="s3cret")) as server:
        assert talk(server, [opening(RATE)]).end == "token"
        assert talk(server, [opening(RATE, token="s3cre")]).end == "token"
        got = talk(server, recording(speech, token="s3cret"))
        assert np.array_equal(got.weights, expected)


def test_pages_of_others_open_no_session(served):
    with pytest.raises(InvalidStatus, match="403"):
        served.connect(origin="https://evil.org")
    with served.connect(origin=f"http://127.0.0.1:{served.port}"):
        pass


@contextmanager
def stopped_reader(server: Running):
    """A client that asks on and reads no answer."""
    small = socket.socket()
    small.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    small.connect(("127.0.0.1", server.port))

    def ask(ws):
        with suppress(ConnectionClosed, OSError):
            ws.send(opening(RATE, live=False))
            while True:
                ws.send('{"type":"style","style":"calm"}')

    with server.connect(sock=small, max_queue=1, close_timeout=0.1) as ws:
        thread = threading.Thread(target=ask, args=(ws,))
        thread.start()
        yield
        small.shutdown(socket.SHUT_RDWR)
        thread.join(20)


def test_a_client_that_stops_reading_is_closed_and_holds_up_nobody(
    face, speech, expected, monkeypatch
):
    monkeypatch.setattr(session, "SEND_S", 2.0)
    with running(face, workers=1) as server, stopped_reader(server):
        assert np.array_equal(talk(server, recording(speech)).weights, expected)
        server.ended("slow", timeout_s=60)
        assert server.metrics.sessions == 0
        assert np.array_equal(talk(server, recording(speech)).weights, expected)


def test_a_failure_of_ours_is_told_and_logged(served, monkeypatch, caplog):
    def fail(*_):
        raise ZeroDivisionError

    monkeypatch.setattr(session, "pack_frames", fail)
    got = talk(served, [opening(RATE, live=False), bytes(2 * RATE)])
    assert (got.end, got.code) == ("defect", 1011)
    assert "ZeroDivisionError" in caplog.text
