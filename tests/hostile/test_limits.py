"""What the system refuses: memory, descriptors, disk, processors; many threads and processes."""

import asyncio
import concurrent.futures
import os
import resource
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import SPEECH, TINY
from small_faces import rigged

import facecode
from facecode import writers
from facecode.errors import OutputWriteError

TALK = np.sin(np.arange(12_000, dtype=np.float32) / 30) / 4
MB = 1 << 20


def codes_of(threads):
    return facecode.load(TINY, threads=threads).animate(TALK).codes.tobytes()


def animate(tmp_path, limit, *args):
    """The command line under a limit of the system: (exit code, stderr, files)."""
    command = [sys.executable, "-m", "facecode.cli", "animate", SPEECH, "--bundle", TINY, "--quiet"]
    done = subprocess.run(
        [*map(str, command), "-o", "talk.npz", *args],
        cwd=tmp_path, capture_output=True, text=True, preexec_fn=limit,
    )  # fmt: skip
    return done.returncode, done.stderr, sorted(path.name for path in tmp_path.iterdir())


@pytest.mark.parametrize("megabytes", [200, 1500])
def test_memory_that_is_refused_is_never_a_crash_or_half_a_file(tmp_path, megabytes):
    """Below some 300 MB Python does not get through its imports, and says so itself."""

    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (megabytes * MB, megabytes * MB))

    code, said, files = animate(tmp_path, limit, "--threads", "1")
    assert code >= 0, said  # a negative one is a signal
    assert files == (["talk.npz"] if code == 0 else [])
    assert "defect" not in said


def test_few_descriptors_are_enough(tmp_path):
    def limit():
        resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))

    assert animate(tmp_path, limit) == (0, "", ["talk.npz"])
    inputs = tmp_path / "in"
    inputs.mkdir()
    for k in range(40):
        (inputs / f"{k}.flac").symlink_to(SPEECH)
    command = [sys.executable, "-m", "facecode.cli", "batch", inputs, "--out", tmp_path / "out"]
    done = subprocess.run(
        [*map(str, command), "--bundle", str(TINY), "--workers", "2", "--quiet"],
        capture_output=True, text=True, preexec_fn=limit,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert len(list((tmp_path / "out").glob("*.npz"))) == 40


@pytest.mark.parametrize("suffix", list(writers.FORMATS))
def test_a_full_disk_leaves_the_old_file(tmp_path, suffix):
    """A limit on the size of files, as a full disk would be, in a process of its own."""
    path = tmp_path / f"talk{suffix}"
    path.write_bytes(b"old")
    program = (
        "import pathlib, resource, sys\nfrom small_faces import rigged\n"
        "from facecode import writers\n"
        "from facecode.errors import OutputWriteError\nclip = rigged(40)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1500, 1500))\n"
        "try:\n    writers.save(clip, pathlib.Path(sys.argv[1]))\n"
        "except OutputWriteError as error:\n    sys.exit(str(error))\n"
    )
    env = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", program, path], capture_output=True, text=True, env=env
    )
    assert done.returncode == 1, done.stderr
    assert "cannot write " in done.stderr
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [(path.name, b"old")]


def test_eight_threads_share_one_face(tiny):
    expected = tiny.animate(TALK).codes
    with concurrent.futures.ThreadPoolExecutor(8) as pool:
        clips = list(pool.map(lambda _: tiny.animate(TALK), range(24)))
    assert all(np.array_equal(clip.codes, expected) for clip in clips)


def test_an_event_loop_with_threads(tiny):
    expected = tiny.animate(TALK).codes

    async def several():
        return await asyncio.gather(*(asyncio.to_thread(tiny.animate, TALK) for _ in range(8)))

    assert all(np.array_equal(clip.codes, expected) for clip in asyncio.run(several()))


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_eight_processes(method, tmp_path):
    """From a process of its own: this one may hold threads of other libraries."""
    (tmp_path / "many.py").write_text(
        "import multiprocessing\nfrom test_limits import codes_of\n"
        "if __name__ == '__main__':\n"
        f"    with multiprocessing.get_context('{method}').Pool(8) as pool:\n"
        "        print(len(set(pool.map(codes_of, [1] * 8)) | {codes_of(1)}))\n"
    )
    env = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, tmp_path / "many.py"], capture_output=True, text=True, env=env, timeout=300
    )
    assert done.stdout == "1\n", done.stderr


def test_a_fork_after_loading_animates_or_ends_clearly():
    """A loaded face in a forked child: its threads stayed behind, so one thread is what works."""
    program = (
        "import os, sys\nimport facecode\nfrom test_limits import TALK\nfrom conftest import TINY\n"
        "face = facecode.load(TINY, threads=1)\ncodes = face.animate(TALK).codes\n"
        "child = os.fork()\n"
        "if child == 0:\n"
        "    os._exit(0 if (face.animate(TALK).codes == codes).all() else 3)\n"
        "sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))\n"
    )
    env = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", program], env=env, timeout=300)
    assert done.returncode == 0


@pytest.mark.parametrize("after_s", [0.3, 0.8, 1.3, 2.0])
def test_control_c_at_any_moment(tmp_path, after_s):
    """Ends with 130 (or as Python ends while it imports) and nothing half-written."""
    command = [sys.executable, "-m", "facecode.cli", "animate", SPEECH, "-o", "talk.mp4", "--quiet"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    time.sleep(after_s)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode in (130, -signal.SIGINT), said
    assert not list(tmp_path.iterdir())


def test_the_old_file_stays_when_its_folder_becomes_read_only(tmp_path, monkeypatch):
    """Root may write anywhere, so the system's answer is played."""
    path = tmp_path / "talk.csv"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(OutputWriteError, match="cannot be written; name another"):
        writers.save(rigged(3), path)
    assert path.read_bytes() == b"old"
