"""The floors of the three packages, as pyproject.toml states them, and the size of a module."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("models_spec/facecode_spec", "runtime/facecode", "exporter/facecode_exporter")
LONGEST = 250


def lint(folder):
    command = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()"]
    paths = [str(folder / package.partition("/")[0]) for package in PACKAGES]
    return subprocess.run(
        [*command, "--no-cache"],
        cwd=folder,
        env={"PYTHONPATH": ":".join(paths), "PATH": ""},
        capture_output=True,
        text=True,
    )


def test_imports_keep_to_the_floors():
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 broken" in done.stdout


def test_the_check_can_fail(tmp_path):
    """A runtime module that imports the exporter, and one that imports torch in a function."""
    for package in PACKAGES:
        shutil.copytree(ROOT / package, tmp_path / package)
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    with (tmp_path / "runtime/facecode/styles.py").open("w") as file:
        file.write("import facecode_exporter.errors\n\ndef f():\n    import torch\n")
    done = lint(tmp_path)
    assert done.returncode == 1
    assert "2 broken" in done.stdout


@pytest.mark.parametrize("package", PACKAGES)
def test_no_module_is_long(package):
    modules = (ROOT / package).rglob("*.py")
    long = {str(m): n for m in modules if (n := len(m.read_text().splitlines())) > LONGEST}
    assert not long
