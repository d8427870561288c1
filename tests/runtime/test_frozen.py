"""PyInstaller's hook lies where the entry point says; tests/test_wheel.py freezes a program."""

from pathlib import Path

from facecode.frozen import hook_folders


def test_the_hook_is_there():
    (folder,) = hook_folders()
    assert "collect_data_files" in (Path(folder) / "hook-facecode.py").read_text()
