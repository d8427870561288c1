"""Folders that appear whole, where their name leads."""

import errno
import os
import subprocess
import sys

import pytest

from facecode.errors import OutputFolderError, OutputWriteError
from facecode_exporter import output_folder
from facecode_exporter.cli.main import main
from facecode_exporter.errors import OutputExistsError
from facecode_exporter.output_folder import replacing


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def put(out, text):
    with replacing(out, "ours") as folder:
        (folder / "ours").write_text(text)


@pytest.fixture(params=["at once", "in two steps"])
def either(request, monkeypatch):
    if request.param == "in two steps":
        monkeypatch.setattr(output_folder.sys, "platform", "other")


@pytest.mark.usefixtures("either")
def test_made_and_replaced(tmp_path):
    for text in ("one", "two"):
        put(tmp_path / "out", text)
        assert (tmp_path / "out/ours").read_text() == text
        assert names(tmp_path) == ["out"]


@pytest.mark.usefixtures("either")
def test_a_link_to_a_folder_stays_one(tmp_path):
    (tmp_path / "disk/bundle").mkdir(parents=True)
    (tmp_path / "out").symlink_to("disk/bundle")
    (tmp_path / "new").symlink_to("disk/not-yet")
    for name in ("out", "new"):
        put(tmp_path / name, "text")
        assert (tmp_path / name).is_symlink()
        assert (tmp_path / name / "ours").read_text() == "text"
    assert names(tmp_path / "disk") == ["bundle", "not-yet"]


def test_what_is_not_ours_is_refused(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/letter").write_text("mine")
    with pytest.raises(OutputExistsError):
        put(tmp_path / "out", "text")
    with pytest.raises(OutputFolderError):
        put(tmp_path / "none/out", "text")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "new", "ours"):
        raise ZeroDivisionError
    assert names(tmp_path) == ["out"]


def test_a_disk_that_refuses_is_one_clear_line(tmp_path, monkeypatch, capsys):
    def refuse(*_args, **_kwargs):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    monkeypatch.setattr(output_folder.tempfile, "mkdtemp", refuse)
    out = tmp_path / "x"
    assert main(["init", "--system", "codetalker-tiny", "--out", str(out)]) == 2
    assert (
        capsys.readouterr().err == f"facecode-export: cannot write {out}: Read-only file system\n"
    )


def test_a_full_disk_leaves_nothing(tmp_path):
    """A limit on the size of files, as a full disk would be; torch writes them."""
    program = (
        "import resource, sys\nfrom facecode_exporter.cli.main import main\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))\n"
        "sys.exit(main(['init', '--system', 'codetalker-tiny', '--out', 'x']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2, done.stderr
    assert "cannot write" in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_what_a_killed_process_left_is_removed_and_what_a_living_one_makes_is_not(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(output_folder, "YOUNG_S", -1.0)
    left = tmp_path / ".out.killed.part"
    left.mkdir()
    (left / "half").write_text("half")
    with replacing(tmp_path / "out", "ours") as slow:
        (slow / "ours").write_text("slow")
        put(tmp_path / "out", "quick")
        assert not left.exists()
        assert slow.is_dir()
    assert (tmp_path / "out/ours").read_text() == "slow"
    assert names(tmp_path) == ["out"]


def test_a_folder_that_cannot_be_written_is_an_output_error(tmp_path):
    with pytest.raises(OutputWriteError), replacing(tmp_path / "out", "ours") as folder:
        (folder / "none/ours").write_text("text")
