"""`facecode bench --live`: what it says of streams that were fed."""

import json

import pytest
from conftest import TINY

import facecode
from facecode.bench import live
from facecode.bench.live import bench_live, live_table
from facecode.errors import LookAheadError


@pytest.fixture(scope="module")
def face():
    return facecode.load(TINY, threads=1)


def test_in_real_time(face):
    report = bench_live(face, 1.2, 100, n_streams=2)
    plan = face.stream(look_ahead_ms=100).plan
    a_stream = len(face.stream(look_ahead_ms=100).feed(live.looped_speech(16_000, 1.2)))
    assert report.n_frames == 2 * a_stream
    least = 1000 * (plan.look_ahead + 1) / plan.fps  # of the last frame of a block
    assert least <= report.latency.p50_ms <= report.latency.p95_ms
    assert report.first_frame.p50_ms >= 1000 * (plan.look_ahead + plan.block) / plan.fps
    assert 0 < report.core_share < 20
    assert 0 <= report.n_late <= report.n_frames
    assert report.memory_mb == report.frame_ms == ()
    assert "2 streams at once" in live_table(report)
    assert "speech to weights" in live_table(report)


def test_fast_and_minute_by_minute(face, monkeypatch):
    monkeypatch.setattr(live, "MINUTE_S", 1)
    report = bench_live(face, 3.0, in_real_time=False)
    assert report.latency is report.first_frame is report.n_late is None
    assert len(report.memory_mb) == len(report.frame_ms) == 3
    assert all(0 < ms < 1000 for ms in report.frame_ms)
    assert "memory after the first minute" in live_table(report)


def test_what_a_stream_refuses_is_told(face):
    with pytest.raises(LookAheadError):
        bench_live(face, 0.5, 1)


def test_an_error_in_a_thread_is_the_callers(face, monkeypatch):
    def broken(*_):
        raise RuntimeError("no more")

    monkeypatch.setattr(live, "_take", broken)
    with pytest.raises(RuntimeError, match="no more"):
        bench_live(face, 0.5, in_real_time=False)


def test_the_command(run_cli, tmp_path):
    done = run_cli("bench", TINY, "--live", "--fast", "--seconds", "1", "--json", "live.json")
    assert done.returncode == 0, done.stderr
    assert "as fast as it goes" in done.stdout
    report = json.loads((tmp_path / "live.json").read_text())
    assert report["n_streams"] == 1
    assert report["n_frames"] > 0
