"""A batch gives what single recordings give, the same with any workers, and can be killed."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import soundfile
from conftest import N_SMALL, SPEECH, TINY, contents

import facecode
from facecode.errors import (
    CorpusError,
    CorpusNotFoundError,
    ModeError,
    NoVerticesError,
    OtherBatchError,
    OutputFolderError,
    OutputSuffixError,
)


@pytest.fixture(scope="module")
def alone(speeches, tmp_path_factory):
    """The results of one worker in this process."""
    out = tmp_path_factory.mktemp("alone") / "out"
    summary = facecode.batch(speeches, out, bundle=str(TINY), workers=1)
    assert (summary.n, summary.n_before, len(summary.failures)) == (N_SMALL + 1, 0, 1)
    assert summary.failures[0].id == "bad"
    return contents(out)


def test_every_recording_has_its_file_and_the_bad_one_its_reason(alone, speeches, tiny, tmp_path):
    wanted = {f"{'ab'[i % 2]}/{i:02d}.npz" for i in range(N_SMALL)}
    assert set(alone) == wanted | {"failures.jsonl"}
    failure = json.loads(alone["failures.jsonl"])
    assert failure["id"] == "bad"
    assert "not audio" in failure["error"]
    (tmp_path / "x.npz").write_bytes(alone["a/00.npz"])
    with np.load(tmp_path / "x.npz") as talk:
        np.testing.assert_array_equal(talk["codes"], tiny.animate(speeches / "a/00.wav").codes)


@pytest.mark.parametrize(("workers", "threads"), [(2, 1), (3, 2), (1, 2)])
def test_the_same_bits_with_any_workers_and_threads(alone, speeches, tmp_path, workers, threads):
    out = tmp_path / "out"
    facecode.batch(speeches, out, bundle=str(TINY), workers=workers, threads=threads)
    assert contents(out) == alone


def test_a_batch_that_is_killed_goes_on(alone, speeches, tmp_path):
    """The whole group of processes with kill -9, as soon as the first portion is done."""
    command = [sys.executable, "-m", "facecode.cli", "batch", str(speeches), "--out", "out"]
    command += ["--bundle", str(TINY), "--workers", "2", "--quiet"]
    process = subprocess.Popen(command, cwd=tmp_path, start_new_session=True)
    done = tmp_path / "out" / ".batch"
    deadline = time.monotonic() + 120
    while not list(done.glob("[0-9]*.json")) and time.monotonic() < deadline:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = {p: p.stat().st_mtime_ns for p in done.glob("[0-9]*.json")}
    assert before
    (tmp_path / "out" / ".facecode-half").write_bytes(b"half a file")
    summary = facecode.batch(speeches, tmp_path / "out", bundle=str(TINY), workers=2)
    assert summary.n_before >= 5
    assert [f.id for f in summary.failures] == ["bad"]
    assert all(p.stat().st_mtime_ns == at for p, at in before.items())
    assert contents(tmp_path / "out") == alone


def test_a_batch_that_is_done_is_left_alone(speeches, tmp_path, alone):
    options = {"bundle": str(TINY), "workers": 1}
    facecode.batch(speeches, tmp_path / "out", **options)
    times = {p: p.stat().st_mtime_ns for p in (tmp_path / "out").rglob("*.npz")}
    summary = facecode.batch(speeches, tmp_path / "out", **options)
    assert (summary.n_before, summary.seconds) == (N_SMALL + 1, 0)
    assert len(summary.failures) == 1
    assert all(p.stat().st_mtime_ns == at for p, at in times.items())
    with pytest.raises(OtherBatchError, match="options differ"):
        facecode.batch(speeches, tmp_path / "out", "b", **options)
    with pytest.raises(OtherBatchError, match="format differ"):
        facecode.batch(speeches, tmp_path / "out", format="mdd", **options)


def test_long_recordings_are_made_in_blocks(tiny, tmp_path):
    speech, rate = soundfile.read(SPEECH, dtype="float32")
    (tmp_path / "in").mkdir()
    soundfile.write(tmp_path / "in" / "long.wav", np.resize(speech, 16 * rate), rate)
    facecode.batch(tmp_path / "in", tmp_path / "out", bundle=str(TINY), workers=1)
    tiny.animate(tmp_path / "in" / "long.wav").save(tmp_path / "one.npz")
    assert (tmp_path / "out" / "long.npz").read_bytes() == (tmp_path / "one.npz").read_bytes()


def test_styles_of_a_list_and_one_that_is_not_there(speeches, tiny, tmp_path):
    rows = "".join(f"{speeches}/a/00.wav,{s or 'none'},{s}\n" for s in ("a", "b", "nobody", ""))
    (tmp_path / "list.csv").write_text(f"audio,id,style\n{rows}")
    summary = facecode.batch(tmp_path / "list.csv", tmp_path / "out", bundle=str(TINY), workers=1)
    assert [f.id for f in summary.failures] == ["nobody"]
    assert "nobody" in summary.failures[0].error
    for name, style in (("a", "a"), ("b", "b"), ("none", None)):
        with np.load(tmp_path / "out" / f"{name}.npz") as talk:
            codes = tiny.animate(speeches / "a/00.wav", style).codes
            np.testing.assert_array_equal(talk["codes"], codes)


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"format": "wav"}, OutputSuffixError),
        ({"mode": "live"}, ModeError),
        ({"offsets": True}, NoVerticesError),
        ({"workers": 0}, ValueError),
    ],
)
def test_mistakes_before_the_first_recording(speeches, tmp_path, options, error):
    with pytest.raises(error):
        facecode.batch(speeches, tmp_path / "out", bundle=str(TINY), **options)
    assert not (tmp_path / "out").exists()


def test_nowhere(speeches, tmp_path):
    with pytest.raises(OutputFolderError):
        facecode.batch(speeches, tmp_path / "no" / "where", bundle=str(TINY))
    with pytest.raises(CorpusNotFoundError):
        facecode.batch(tmp_path / "none", tmp_path / "out", bundle=str(TINY))
    with pytest.raises(CorpusError, match="no recording"):
        facecode.batch(tmp_path, tmp_path / "out", bundle=str(TINY))


def test_command_line(speeches, run_cli, tmp_path):
    done = run_cli("batch", speeches, "--out", "out", "--bundle", TINY, "--workers", "1")
    assert done.returncode == 2
    assert f"{N_SMALL} of {N_SMALL + 1} recordings" in done.stdout
    assert "1 failed, see out/failures.jsonl" in done.stdout
    assert f"{N_SMALL + 1}/{N_SMALL + 1}" in done.stderr
    again = run_cli("batch", speeches, "--out", "out", "--bundle", TINY, "--workers", "1")
    assert f"({N_SMALL + 1} were done before)" in again.stdout
    other = run_cli("batch", speeches, "--out", "out", "--bundle", TINY, "--style", "b")
    assert other.returncode == 2
    assert "another batch" in other.stderr
    assert "Traceback" not in done.stderr + other.stderr
