"""Heads as .usda, .usdz and .usdc: text, archive, and what is refused."""

import io
import re
import sys
import zipfile

import numpy as np
import pytest
import soundfile
from small_faces import NAMES, changed, cut, rigged, still

from facecode import writers
from facecode.errors import MissingExtraError, NoFacesError, OutputWriteError
from facecode.writers import usdz
from facecode.writers.usd.text import identifiers, quoted
from facecode.writers.usdc import USDC

SPEECH = np.sin(np.arange(3200, dtype=np.float32) / 7)


def written(clips, suffix):
    file = io.BytesIO()
    writers.write(clips, file, writers.FORMATS[suffix])
    return file.getvalue()


def test_text_holds_names_weights_and_times():
    clip = rigged(7, fps=25.0)
    text = written(clip, ".usda").decode()
    assert text.startswith("#usda 1.0\n")
    for fact in ('upAxis = "Y"', "metersPerUnit = 1", "timeCodesPerSecond = 25.0"):
        assert fact in text
    assert "endTimeCode = 6" in text
    rows = re.findall(r"^ +(\d+): \[(.*)\],$", text, re.MULTILINE)
    assert [int(frame) for frame, _ in rows] == list(range(7))
    weights = np.array([row.split(",") for _, row in rows], np.float32)
    assert np.abs(weights - clip.weights).max() < 1e-5
    assert re.findall(r'BlendShape "(\w+)"', text) == list(NAMES)


def test_identifiers_are_valid_and_distinct():
    names = ["jaw open", "jaw_open", "jaw-open", "1st", "", "ä", "jaw_open_2"]
    found = identifiers(names)
    assert all(re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", each) for each in found)
    assert len(set(found)) == len(names)
    assert found[1] == "jaw_open"
    assert found[6] == "jaw_open_2"
    assert quoted('a"b\\') == '"a\\"b\\\\"'


@pytest.mark.parametrize("spoken", [True, False])
def test_members_are_stored_and_aligned(spoken):
    sound = {"audio": SPEECH, "sample_rate": 16000} if spoken else {}
    content = written(rigged(**sound), ".usdz")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        members = archive.infolist()
        assert [each.filename for each in members] == ["face.usda", "speech.wav"][: 1 + spoken]
        for each in members:
            assert each.compress_type == zipfile.ZIP_STORED
            lengths = content[each.header_offset + 26 : each.header_offset + 30]
            n_name, n_extra = np.frombuffer(lengths, "<u2")
            begins = each.header_offset + 30 + int(n_name) + int(n_extra)
            assert begins % 64 == 0
            assert content[begins : begins + each.file_size] == archive.read(each)
        layer = archive.read("face.usda").decode()
        assert ("@speech.wav@" in layer) == spoken
        if spoken:
            heard, rate = soundfile.read(io.BytesIO(archive.read("speech.wav")), dtype="float32")
            assert rate == 16000
            assert np.abs(heard - SPEECH).max() <= 1 / 32768


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_same_input_same_bytes(suffix):
    clip = rigged(9)
    assert written(clip, suffix) == written(clip, suffix)


@pytest.mark.parametrize("suffix", [".usda", ".usdz"])
def test_no_faces_no_file(suffix, tmp_path):
    with pytest.raises(NoFacesError, match=f"\\{suffix} needs faces"):
        writers.save(changed(rigged(), faces=None), tmp_path / f"talk{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_takes_and_faces_without_a_rig():
    clips = [changed(rigged(seed=seed), rig=None) for seed in range(3)]
    text = written(clips, ".usda").decode()
    assert re.findall(r'SkelRoot "(\w+)"', text) == ["face_1", "face_2", "face_3"]
    assert "component_01" in text


def test_an_archive_that_is_too_large_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(usdz.zipfile, "ZIP64_LIMIT", 1000)
    with pytest.raises(OutputWriteError, match="2 GiB"):
        writers.save(rigged(), tmp_path / "talk.usdz")
    assert list(tmp_path.iterdir()) == []


def test_without_usd_core_usdc_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(MissingExtraError, match=r"'\.\[usd\]'"):
        writers.save(rigged(), tmp_path / "talk.usdc")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("cuts", [[300], [0, 1, 255, 44], [256, 44]])
def test_points_do_not_depend_on_the_blocks(cuts):
    pytest.importorskip("pxr", reason="no usd-core: pip install 'facecode[usd]'")
    clip, whole, blocks = rigged(300), io.BytesIO(), io.BytesIO()
    USDC.write(clip, whole, False)
    USDC.write_blocks(still(clip), 300, cut(clip, cuts), blocks)
    assert blocks.getvalue() == whole.getvalue()
    none = io.BytesIO()
    USDC.write_blocks(still(clip), 0, [], none)
    assert len(none.getvalue()) > 1000
