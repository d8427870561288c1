"""Programs frozen with PyInstaller, which finds the hook by the entry point `pyinstaller40`."""

from pathlib import Path


def hook_folders() -> list[str]:
    """Where PyInstaller finds `hook-facecode.py`."""
    return [str(Path(__file__).parent)]
