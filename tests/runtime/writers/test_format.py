"""A format is one object: what it needs is checked before the work is done."""

import dataclasses

import numpy as np
import pytest
from conftest import SPEECH, TINY

from facecode import writers
from facecode.clip import Rig
from facecode.errors import NoFacesError, NoRigError, OutputSuffixError
from facecode.takes import Takes
from facecode.writers.format import Format, by_path


@pytest.fixture(scope="module")
def clip(tiny):
    return tiny.animate(SPEECH)


def test_a_format_for_one_face_refuses_several_by_name(clip, tmp_path, monkeypatch):
    one = Format(".one", lambda clip, file, progress: file.write(b"1"))
    monkeypatch.setitem(writers.FORMATS, ".one", one)
    clip.save(tmp_path / "a.one")
    Takes((clip,)).save(tmp_path / "b.one")
    assert (tmp_path / "b.one").read_bytes() == b"1"
    with pytest.raises(OutputSuffixError, match=r"\.one holds one face, and there are 2"):
        Takes((clip, clip)).save(tmp_path / "c.one")
    assert not (tmp_path / "c.one").exists()


def test_needs_are_errors_with_what_to_do_next(clip, tmp_path, monkeypatch):
    def write(clip, file, progress):
        file.write(b"1")

    monkeypatch.setitem(writers.FORMATS, ".rig", Format(".rig", write, needs_rig=True))
    monkeypatch.setitem(writers.FORMATS, ".srf", Format(".srf", write, needs_faces=True))
    with pytest.raises(NoRigError, match="--units FILE"):
        clip.save(tmp_path / "a.rig")
    rig = Rig(("jawOpen",), np.zeros((1, 42, 3), np.float32))
    dataclasses.replace(clip, rig=rig).save(tmp_path / "a.rig")
    with pytest.raises(NoFacesError, match="--template MESH"):
        dataclasses.replace(clip, faces=None).save(tmp_path / "a.srf")


def test_by_path_hands_over_a_file_name_of_the_suffix(clip, tmp_path, monkeypatch):
    def write(clip, path, progress):
        path.write_text(path.suffix)

    monkeypatch.setitem(writers.FORMATS, ".cache", Format(".cache", by_path(".cache", write)))
    clip.save(tmp_path / "x.cache")
    assert (tmp_path / "x.cache").read_text() == ".cache"


def test_a_clip_carries_what_writers_need(tiny):
    clip = tiny.animate(SPEECH, {"a": 0.25, "c": 0.75})
    assert (clip.unit, clip.metres_per_unit, clip.up_axis) == ("metres", 1.0, "y")
    assert clip.styles == {"a": 0.25, "c": 0.75}
    assert clip.lip_pair is None
    assert clip.n_frames == len(clip.offsets) == 212


def test_every_format_says_what_it_cannot_write(run_cli):
    done = run_cli("animate", SPEECH, "--bundle", TINY, "-o", "talk.xyz")
    assert done.returncode == 2
    assert ", ".join(writers.FORMATS) in done.stderr
