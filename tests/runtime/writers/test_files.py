"""Where output files land, and what they replace."""

import os
import stat
import subprocess
import sys
import threading

import numpy as np
import pytest
from conftest import SPEECH

from facecode.errors import OutputFolderError, OutputWriteError
from facecode.writers import files
from facecode.writers.files import check_folder, writing


@pytest.fixture(params=["nameless", "named"])
def either(request, monkeypatch):
    """With and without files that have no name until they are whole."""
    if request.param == "named":
        monkeypatch.setattr(files, "_nameless", lambda folder: None)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def put(path, data=b"new"):
    with writing(path) as file:
        file.write(data)


@pytest.mark.usefixtures("either")
def test_a_file_is_made_and_replaced(tmp_path):
    for data in (b"one", b"two"):
        put(tmp_path / "a.npz", data)
        assert (tmp_path / "a.npz").read_bytes() == data
    mask = os.umask(0)
    os.umask(mask)
    assert stat.S_IMODE((tmp_path / "a.npz").stat().st_mode) == 0o666 & ~mask
    assert names(tmp_path) == ["a.npz"]


@pytest.mark.usefixtures("either")
def test_an_error_leaves_the_old_one(tmp_path):
    put(tmp_path / "a.npz", b"old")
    with pytest.raises(ZeroDivisionError), writing(tmp_path / "a.npz") as file:
        file.write(bytes([1 // 0]))
    assert (tmp_path / "a.npz").read_bytes() == b"old"
    assert names(tmp_path) == ["a.npz"]


@pytest.mark.usefixtures("either")
def test_a_link_stays_and_what_it_leads_to_is_written(tmp_path):
    (tmp_path / "far").mkdir()
    for name in ("there.npz", "not-yet.npz"):
        link = tmp_path / f"link-{name}"
        link.symlink_to(f"far/{name}")
        (tmp_path / "far/there.npz").write_bytes(b"old")
        put(link)
        assert link.is_symlink()
        assert (tmp_path / "far" / name).read_bytes() == b"new"
    (tmp_path / "lost.npz").symlink_to("nowhere/x.npz")
    with pytest.raises(OutputFolderError, match="nowhere"):
        check_folder(tmp_path / "lost.npz")


def test_a_pipe_gets_the_bytes_and_stays(tmp_path):
    pipe = tmp_path / "talk.npz"
    os.mkfifo(pipe)
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    put(pipe)
    reader.join(10)
    assert got == [b"new"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_device_stays(tmp_path):
    device = tmp_path / "talk.npz"
    device.symlink_to("/dev/null")
    put(device)
    assert device.is_symlink()
    assert stat.S_ISCHR(device.stat().st_mode)


def test_a_folder_that_vanishes_is_a_clear_error(tmp_path):
    (tmp_path / "out").mkdir()
    with (
        pytest.raises(OutputWriteError, match=r"cannot write .*x\.npz"),
        writing(tmp_path / "out/x.npz"),
    ):
        (tmp_path / "out").rmdir()
    assert not list(tmp_path.iterdir())


def test_format_goes_with_standard_output(run_cli, tmp_path, tiny):
    done = run_cli("animate", SPEECH, "-o", "-", "--format", "csv", "--quiet")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("Timecode,BlendShapeCount,")
    for args in (
        ["-o", "talk.npz", "--format", "mp4"],
        ["-o", "-", "-o", "a.npz", "--format", "csv"],
    ):
        done = run_cli("animate", SPEECH, *args)
        assert done.returncode == 2
        assert "facecode: " in done.stderr
    assert not list(tmp_path.iterdir())


def test_killed_in_the_middle_nothing_is_left(tmp_path):
    """Where the system has nameless files; elsewhere a hidden one may stay."""
    if files._nameless(tmp_path) is None:
        return
    program = (
        "import os, signal, sys\nfrom pathlib import Path\nfrom facecode.writers import writing\n"
        "with writing(Path(sys.argv[1])) as file:\n"
        "    file.write(b'half'); file.flush(); os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    put(tmp_path / "a.npz", b"old")
    done = subprocess.run([sys.executable, "-c", program, tmp_path / "a.npz"])
    assert done.returncode == -9
    assert names(tmp_path) == ["a.npz"]
    assert (tmp_path / "a.npz").read_bytes() == b"old"


def test_what_was_held_open_reads_the_old_one(tmp_path):
    np.save(tmp_path / "a.npy", np.zeros(3))
    held = np.load(tmp_path / "a.npy", mmap_mode="r")
    put(tmp_path / "a.npy")
    assert held.sum() == 0
