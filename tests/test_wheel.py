"""What users install: the wheel without extras, in an environment without torch."""

import json
import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import numpy as np
import pytest
from conftest import SPEECH, TINY

ROOT = Path(__file__).parents[1]
ABSENT = {"torch", "onnx", "onnxscript", "transformers"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(out), str(ROOT)]
    subprocess.run(command, check=True)
    return next(out.glob("facecode-*.whl"))


@pytest.fixture(scope="module")
def fresh(wheel, tmp_path_factory):
    """The bin folder of a new environment that holds the wheel and its dependencies."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder, with_pip=True)
    subprocess.run([folder / "bin" / "pip", "install", "-q", wheel], check=True)
    return folder / "bin"


def test_wheel_holds_the_three_packages_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.partition("/")[0] for name in names}
    assert tops == {
        "facecode", "facecode_exporter", "facecode_spec", f"facecode-{version(wheel)}.dist-info"
    }  # fmt: skip
    for name in ("facecode/py.typed", "facecode/assets/speech.flac", "facecode_spec/py.typed"):
        assert name in names


def version(wheel):
    return wheel.name.split("-")[1]


def test_torch_is_absent(fresh):
    listed = subprocess.run(
        [fresh / "pip", "list", "--format", "json"], capture_output=True, check=True
    )
    installed = {package["name"].lower() for package in json.loads(listed.stdout)}
    assert {"facecode", "onnxruntime", "numpy"} <= installed
    assert not installed & ABSENT


def test_animate_speech(fresh, tmp_path, tiny):
    subprocess.run(
        [fresh / "facecode", "animate", SPEECH, "--bundle", TINY, "-o", "talk.npz", "--quiet"],
        cwd=tmp_path,
        check=True,
    )
    with np.load(tmp_path / "talk.npz") as talk:
        np.testing.assert_array_equal(talk["codes"], tiny.animate(SPEECH).codes)


def test_exporter_names_the_missing_extra(fresh, tmp_path):
    done = subprocess.run(
        [fresh / "facecode-export", "init", "--system", "codetalker-tiny", "--out", "x"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "pip install '.[export]'" in done.stderr


def test_film_names_the_missing_extra(fresh, tmp_path):
    done = subprocess.run(
        [fresh / "facecode", "animate", SPEECH, "--bundle", TINY, "-o", "talk.mp4"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert (
        done.stderr
        == "facecode: writing .mp4 needs av; in a clone of facecode: pip install '.[video]'\n"
    )


def test_start_up(fresh, tmp_path):
    """`import facecode` takes 0.33 s of processor time on an AVX2 EPYC, numpy half of it (bar 0.4).

    Without the threads that numpy starts and that wait; processor time, since others run beside it.
    """
    python = fresh / "python"
    program = (
        "import time; s = time.process_time(); import facecode; print(time.process_time() - s)"
    )

    def import_s():
        env = os.environ | {"OPENBLAS_NUM_THREADS": "1"}
        done = subprocess.run([python, "-c", program], capture_output=True, check=True, env=env)
        return float(done.stdout)

    assert min(import_s() for _ in range(4)) < 0.4


def test_a_frozen_program_has_the_packaged_models(fresh, tmp_path):
    """PyInstaller finds our hook, and the one-folder program animates with what it carries."""
    subprocess.run([fresh / "pip", "install", "-q", "pyinstaller>=6"], check=True)
    (tmp_path / "app.py").write_text("from facecode.cli import main\n\nmain()\n")
    build = [fresh / "pyinstaller", "--log-level", "ERROR", "--onedir", "app.py"]
    subprocess.run(build, cwd=tmp_path, check=True)
    command = [tmp_path / "dist/app/app", "animate", SPEECH, "-o", "talk.npz", "--quiet"]
    subprocess.run(command, cwd=tmp_path, check=True)
    with np.load(tmp_path / "talk.npz") as talk:
        assert talk["vertices"].shape[1] == 5886
