"""The command line in another process: results, streams, exit codes, and mistakes."""

import json
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import soundfile
from conftest import SPEECH, TINY

from facecode import writers
from facecode.cli import main
from facecode.errors import OutputWriteError
from facecode.writers.format import Format


def animate(run_cli, *args, audio=SPEECH, **kwargs):
    return run_cli("animate", audio, "--bundle", TINY, *args, **kwargs)


def test_animate(run_cli, tmp_path, tiny):
    start = time.perf_counter()
    done = animate(run_cli, "-o", "talk.npz", "--style", "a:0.25,b:0.75")
    assert time.perf_counter() - start < 10  # 0.5 s on two idle cores
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("talk.npz: 212 frames at 30 fps (7.07 s), 42 vertices")
    assert "animate: 100%" in done.stderr
    clip = tiny.animate(SPEECH, {"a": 0.25, "b": 0.75})
    with np.load(tmp_path / "talk.npz") as talk:
        assert {"codes", "fps", "vertices"} <= set(talk.files)
        np.testing.assert_array_equal(talk["codes"], clip.codes)
        np.testing.assert_allclose(talk["vertices"], clip.vertices, atol=1e-6)
        assert talk["fps"] == 30


def test_quiet_says_nothing(run_cli):
    done = animate(run_cli, "-o", "talk.npz", "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_standard_streams(run_cli, tmp_path, tiny):
    done = animate(run_cli, "-o", "-", audio="-", input=SPEECH.read_bytes(), text=False)
    assert done.returncode == 0, done.stderr
    (tmp_path / "piped.npz").write_bytes(done.stdout)
    with np.load(tmp_path / "piped.npz") as talk:
        np.testing.assert_array_equal(talk["codes"], tiny.animate(SPEECH).codes)


def test_info(run_cli):
    done = run_cli("info", TINY)
    assert done.returncode == 0
    for fact in ("codetalker-tiny", "42 vertices at 30 fps", "a, b, c", "fp32", "172 of 172 codes",
                 "whole clip", "decoder_step.onnx"):  # fmt: skip
        assert fact in done.stdout
    plain = json.loads(run_cli("info", TINY, "--json").stdout)
    assert plain["styles"] == ["a", "b", "c"]
    assert plain["modes"]["exact"]["look_ahead_ms"] is None


def test_bench(run_cli, tmp_path):
    done = run_cli("bench", TINY, "--seconds", "2", "--threads", "1", "--json", "bench.json")
    assert done.returncode == 0, done.stderr
    for fact in ("decoder step", "motion decoder", "vertex head", "p99", "real-time factor",
                 "peak memory", "1 threads", "onnxruntime"):  # fmt: skip
        assert fact in done.stdout
    report = json.loads((tmp_path / "bench.json").read_text())
    assert report["n_frames"] == 59
    assert report["frame"]["p50_ms"] <= report["frame"]["p95_ms"] <= report["frame"]["p99_ms"]
    assert report["total_s"] >= report["encoder_s"] > 0
    window = run_cli("bench", TINY, "--seconds", "1", "--mode", "window", "--json", "-")
    assert json.loads(window.stdout)["window"] == 24  # the bundle's choice
    assert len(json.loads(window.stdout)["frame_ms"]) == 29


def test_bench_compares_and_plots(run_cli, tmp_path):
    pytest.importorskip("matplotlib")
    both = ("bench", TINY, "--compare", TINY, "--seconds", "1", "--plot", "latency.png")
    done = run_cli(*both, "--mode", "window", "--window", "4", "--json", "both.json")
    assert done.returncode == 0, done.stderr
    assert "real-time factor" in done.stdout
    assert (tmp_path / "latency.png").read_bytes().startswith(b"\x89PNG")
    assert [r["window"] for r in json.loads((tmp_path / "both.json").read_text())] == [4, 4]


def test_plot_without_matplotlib_names_the_extra(tiny, tmp_path, monkeypatch):
    import sys

    from facecode.bench.measure import benchmark
    from facecode.bench.report import plot
    from facecode.errors import MissingExtraError

    report = benchmark(tiny, 0.0, 0.2, None)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingExtraError, match=r"pip install '\.\[plots\]'"):
        plot([report], tmp_path / "latency.png")


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["-o", "talk.avi"], "expected one of .npz, .mp4"),
        (["-o", "none/talk.npz"], "create it first"),
        (["-o", "talk.npz", "--style", "d"], "no style 'd'"),
        (["-o", "talk.npz", "--style", "a:b"], "a:0.3,b:0.7"),
        (["-o", "talk.npz", "--mode", "exact", "--window", "4"], "a window goes with"),
        (["-o", "talk.npz", "--template", "none.ply"], "no template file"),
        (["-o", "talk.npz", "--bundle", "none"], "no bundle at none"),
        (["-o", "talk.npz", "--threads", "5000"], "got 5000 threads; expected 1 to 256"),
    ],
)
def test_mistakes_are_one_line_and_exit_2(run_cli, tmp_path, args, message):
    done = animate(run_cli, *args)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stderr.startswith("facecode: ")
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("content", [b"", b"not audio"])
def test_audio_that_is_none(run_cli, tmp_path, content):
    file = tmp_path / "noise.wav"
    file.write_bytes(content)
    done = animate(run_cli, "-o", "talk.npz", audio=file)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "is not audio" in done.stderr
    done = animate(run_cli, "-o", "talk.npz", audio=tmp_path / "missing.wav")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert [f.name for f in tmp_path.iterdir()] == ["noise.wav"]


@pytest.mark.parametrize("args", [[], ["animate"], ["animate", "x", "-o", "y", "--threads", "0"]])
def test_usage_errors_exit_2(run_cli, args):
    done = run_cli(*args)
    assert done.returncode == 2
    assert "usage:" in done.stderr


def test_debug_shows_the_traceback(run_cli):
    done = animate(run_cli, "-o", "talk.npz", "--style", "d", "--debug")
    assert done.returncode == 2
    assert "Traceback" in done.stderr


def test_a_defect_exits_1_without_a_traceback(monkeypatch, capsys, tmp_path):
    def fail(*_args, **_kwargs):
        raise ZeroDivisionError("oops")

    monkeypatch.setattr("facecode.loop.engine.Engine.encode", fail)
    out = str(tmp_path / "talk.npz")
    assert main(["animate", str(SPEECH), "--bundle", str(TINY), "-o", out]) == 1
    err = capsys.readouterr().err
    assert "defect: ZeroDivisionError: oops" in err
    assert "Traceback" not in err


def test_full_disk_leaves_nothing(run_cli, tmp_path):
    """A limit on the file size stops the writer half-way, as a full disk would."""

    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000))

    (tmp_path / "talk.npz").write_bytes(b"old result")
    done = animate(run_cli, "-o", "talk.npz", "--quiet", preexec_fn=limit)
    assert done.returncode == 2
    assert "cannot write talk.npz" in done.stderr
    assert [f.name for f in tmp_path.iterdir()] == ["talk.npz"]
    assert (tmp_path / "talk.npz").read_bytes() == b"old result"


def test_interrupted_writer_leaves_nothing(tiny, tmp_path, monkeypatch):
    def interrupted(_animation, file, _progress):
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setitem(writers.FORMATS, ".npz", Format(".npz", interrupted))
    with pytest.raises(KeyboardInterrupt):
        tiny.animate(SPEECH).save(tmp_path / "talk.npz")
    assert not list(tmp_path.iterdir())


def test_terminated_writer_leaves_nothing(monkeypatch, tmp_path):
    def terminated(_animation, file, _progress):
        file.write(b"half")
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(5)

    monkeypatch.setitem(writers.FORMATS, ".npz", Format(".npz", terminated))
    out = str(tmp_path / "talk.npz")
    with pytest.raises(SystemExit) as ended:
        main(["animate", str(SPEECH), "--bundle", str(TINY), "-o", out, "--quiet"])
    assert ended.value.code == 143
    assert not list(tmp_path.iterdir())


def test_save_into_a_folder_name(tiny, tmp_path):
    (tmp_path / "talk.npz").mkdir()
    with pytest.raises(OutputWriteError, match="is a folder"):
        tiny.animate(SPEECH).save(tmp_path / "talk.npz")


@pytest.mark.parametrize(
    ("number", "code", "said"), [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "")]
)
def test_interrupt(tmp_path, number, code, said):
    """Ctrl-C, or a request to end, during a long clip: one line at most, and no file."""
    long = tmp_path / "long.wav"
    samples, rate = soundfile.read(SPEECH, dtype="float32")
    soundfile.write(long, np.resize(samples, 120 * rate), rate)
    args = ["animate", str(long), "--bundle", str(TINY), "-o", "talk.npz"]
    process = subprocess.Popen(
        [sys.executable, "-m", "facecode.cli", *args],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        # tests that were started in the background hand down a SIGINT that is ignored
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while "frame/s" not in process.stderr.readline(200):  # the loop has begun
        assert process.poll() is None
    process.send_signal(number)
    rest = process.communicate(timeout=60)[1]
    assert process.returncode == code
    assert said in rest
    assert "Traceback" not in rest
    assert [f.name for f in tmp_path.iterdir()] == ["long.wav"]
