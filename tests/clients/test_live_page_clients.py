"""The live page in Debian's Chromium, with a recorded voice as its microphone."""

import json
import queue
import subprocess
import sys
import threading
from contextlib import contextmanager

import numpy as np
import pytest
import soundfile
import soxr
from conftest import SPEECH
from gltf_clients import HERE, chromium, node_modules, run
from serving import FINISH, chunks, opening, running, talk

import facecode
from facecode_exporter.measures.lip_sync import closures, opening_curve, relative_opening

pytestmark = pytest.mark.clients
WORDS = (
    "And Mr. John Dashwood had then leisure to consider how much there might be prudently in his "
    "power to do for them."
)
SCRIPT = HERE / "live_page_check.mjs"


@pytest.fixture(scope="module")
def face():
    return facecode.load(threads=1)


@pytest.fixture(scope="module")
def microphone(tmp_path_factory):
    """The packaged recording as Chromium wants it."""
    samples, rate = soundfile.read(SPEECH, dtype="float32")
    path = tmp_path_factory.mktemp("microphone") / "speech.wav"
    soundfile.write(path, soxr.resample(samples, rate, 48000), 48000, subtype="PCM_16")
    return path


def opening_of(face, weights):
    """Mouth opening (T,) of weights (T, K) on the packaged head."""
    pair = list(face.bundle.lip_pair)
    moved = face.bundle.template[pair] + np.einsum(
        "tk,kvc->tvc", weights, face.bundle.rig.deltas[:, pair]
    )
    return opening_curve(moved, (0, 1), face.bundle.template[pair])


def heard_of(found, wanted):
    """The part of `found` in step with `wanted`, NaN where the microphone was not yet open."""
    padded = np.concatenate([np.full(60, np.nan), found, np.full(len(wanted), found[-1])])
    tried = {}
    for shift in range(120):
        part = padded[shift : shift + len(wanted)]
        known = np.isfinite(part)
        tried[shift] = np.corrcoef(part[known], wanted[known])[0, 1]
    shift = max(tried, key=tried.get)
    return padded[shift : shift + len(wanted)], tried[shift]


def test_the_head_speaks_with_you(face, microphone, tmp_path, monkeypatch):
    """Late, if the machine is slow, and whole: what is skipped cannot be compared."""
    monkeypatch.setattr("facecode.serve.backlog.MOST_BEHIND_S", 1e9)
    pytest.importorskip("pocketsphinx")
    from facecode.audio import load_audio
    from facecode_exporter.corpus.phones import Aligner

    modules, browser, picture = node_modules(), chromium(), tmp_path / "live.png"
    with running(face) as server:
        url = f"http://127.0.0.1:{server.port}/"
        found = json.loads(run("node", SCRIPT, modules, browser, url, microphone, "talk", picture))
        server.ended("left", "finished", n=3)  # a page that leaves late has been served whole
        assert server.metrics.ended["defect"] == 0
    print(found["latency"], found["details"])
    assert found["errors"] == []
    own = (url, f"ws://127.0.0.1:{server.port}/", f"blob:{url}")
    assert all(request.startswith(own) for request in found["requests"])
    assert (found["before"], found["after"]) == ("Press Speak, or drop an audio file",) * 2
    assert (found["meter_before"], found["pressed"]) == (False, "true")
    assert found["rests"]
    assert int(found["latency"]) > 250
    assert "by design 333" in found["details"]
    assert found["shown"] >= max(found["delays"][-5:])
    assert found["file_played"] == 213
    assert not found["wider_than_the_phone"]

    frames = np.array(found["frames"], np.float32)
    index = frames[:, 0].astype(int)
    weights = np.stack([np.interp(np.arange(index[-1] + 1), index, w) for w in frames[:, 2:].T], 1)
    heard = opening_of(face, weights)
    live = face.animate(SPEECH, mode="live", vertices=False)
    offline = opening_of(face, live.weights)
    here, correlation = heard_of(heard, offline)
    first = np.isnan(here).sum() / live.fps
    print(f"r {correlation:.3f}, {first:.2f} s before the microphone was open")
    assert first < 1.5
    assert correlation > 0.85
    phones = Aligner().align(load_audio(SPEECH, 16_000), WORDS)
    phones = [phone for phone in phones if phone.start_s > first + 0.2]
    met = closures(phones, relative_opening(np.nan_to_num(here)), live.fps)
    known = closures(phones, relative_opening(offline), live.fps)
    print(f"P B M closed: {[v.met for v in met]}, without a page {[v.met for v in known]}")
    assert len(met) >= 5
    assert [v.met for v in met] == [v.met for v in known]


@contextmanager
def waiting(url, microphone):
    """A page that speaks; `heard(text)` waits until it says something."""
    command = ["node", SCRIPT, node_modules(), chromium(), url, microphone, "wait"]
    process = subprocess.Popen(
        [str(word) for word in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    lines = queue.Queue()

    def read():
        for line in process.stdout:
            lines.put(line.strip())

    def heard(text):
        while text not in lines.get(timeout=60):
            pass

    thread = threading.Thread(target=read)
    thread.start()
    try:
        yield heard
    finally:
        process.stdin.close()
        try:
            process.wait(30)
        finally:
            process.kill()
            thread.join(10)


def test_a_page_waits_for_a_place(face, microphone):
    with running(face, sessions=1) as server, server.connect() as first:
        first.send(opening(16000))
        first.recv(20)
        with waiting(f"http://127.0.0.1:{server.port}/", microphone) as heard:
            heard("All places are taken")
            first.close()
            heard("Listening")
            heard("frames")


def test_a_page_comes_back_with_its_server(microphone):
    def start(port):
        command = [sys.executable, "-m", "facecode.cli", "serve", "--port", str(port)]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        return process, process.stdout.readline().strip()

    process, url = start(0)
    try:
        with waiting(url, microphone) as heard:
            heard("frames")
            process.kill()
            process.wait()
            heard("The server is gone; trying again")
            process, again = start(int(url.rstrip("/").rpartition(":")[2]))
            assert again == url
            heard("Listening")
            heard("frames")
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_the_same_recording_through_the_socket_is_the_clip(face):
    """What the page is compared with: mode `live` of the same recording."""
    samples, rate = soundfile.read(SPEECH, dtype="int16")
    with running(face) as server:
        messages = [opening(rate, live=False), *chunks(samples, rate // 4), FINISH]
        got = talk(server, messages)
    live = face.animate(SPEECH, mode="live", vertices=False)
    assert np.array_equal(got.weights, live.weights)
