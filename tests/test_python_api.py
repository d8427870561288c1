"""The public surface, pinned; and one place for the version."""

import re
from importlib.metadata import version
from pathlib import Path

import facecode
from facecode import errors, writers

ROOT = Path(__file__).parents[1]
NAMES = {
    "Animation", "Animator", "AudioSource", "Blocks", "Bundle", "Clip", "Compute", "FacecodeError",
    "Mode", "Rig", "Samples", "Style", "Takes", "TemplateSource", "__version__", "animate_many",
    "batch", "load", "read_clip",
}  # fmt: skip


def test_public_names():
    assert set(facecode.__all__) == NAMES
    assert all(hasattr(facecode, name) for name in NAMES)
    assert list(facecode.__all__) == sorted(facecode.__all__)


def test_formats():
    assert list(writers.FORMATS)[:2] == [".npz", ".mp4"]
    assert all(found.suffix == suffix for suffix, found in writers.FORMATS.items())


def test_names_that_documents_advertise():
    from facecode.writers.mp4 import write_side_by_side

    assert callable(write_side_by_side)
    assert issubclass(errors.ProviderError, errors.FacecodeError)


def test_one_place_for_the_version():
    """The package itself; pyproject.toml reads it from there."""
    assert facecode.__version__ == version("facecode")
    assert not re.search(r"^version = \"\d", (ROOT / "pyproject.toml").read_text(), re.MULTILINE)
