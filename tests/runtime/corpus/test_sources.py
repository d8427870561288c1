"""Folders, lists and tar files as a corpus."""

import io
import json
import tarfile

import pytest
import soundfile
from conftest import SPEECH

from facecode.corpus.reader import Reader
from facecode.corpus.sources import recordings_in
from facecode.errors import CorpusError


def test_a_folder(speeches):
    found = recordings_in(speeches)
    assert found[0].id == "a/00"
    assert found[-1].id == "bad"
    assert all(r.size == r.path.stat().st_size for r in found)


def test_a_list_of_lines(tmp_path):
    (tmp_path / "list.txt").write_text("one/a.wav\n\n../b.wav\n/far/c.wav\n")
    found = recordings_in(tmp_path / "list.txt")
    assert [r.id for r in found] == ["one/a", "b", "c"]
    assert found[0].path == tmp_path / "one/a.wav"


def test_a_list_of_json(tmp_path):
    (tmp_path / "head.ply").touch()
    entries = [
        {"audio": "a.wav", "id": 7, "style": "calm"},
        {"audio": "b.wav", "template": "head.ply"},
    ]
    (tmp_path / "list.jsonl").write_text("\n".join(map(json.dumps, entries)))
    one, two = recordings_in(tmp_path / "list.jsonl")
    assert (one.id, one.style, one.template) == ("7", "calm", None)
    assert (two.id, two.style, two.template) == ("b", None, str(tmp_path / "head.ply"))


def test_a_tar_file(tmp_path):
    with tarfile.open(tmp_path / "000.tar", "w") as tar:
        for name, data in (
            ("s/one.flac", SPEECH.read_bytes()),
            ("s/one.json", b'{"style": "calm"}'),
            ("s/one.txt", b"words"),
        ):
            member = tarfile.TarInfo(name)
            member.size = len(data)
            tar.addfile(member, io.BytesIO(data))
    (found,) = recordings_in(tmp_path)
    assert (found.id, found.style) == ("s/one", "calm")
    samples, _ = soundfile.read(Reader().audio(found))
    assert len(samples) == soundfile.info(SPEECH).frames


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("x.csv", "file\na.wav\n", "`audio`"),
        ("x.jsonl", "{", "line 1"),
        ("x.txt", "a/x.wav\nb/../a/x.wav\na/x.flac\n", "two recordings"),
        ("x.csv", "audio,id\na.wav,../../x\n", "relative path"),
        ("x.csv", "audio,id\na.wav,/etc/x\n", "relative path"),
        ("x.tar", "not a tar file", "uncompressed"),
        ("x.wav", "RIFF", "facecode animate"),
        ("x.txt", "", "no recording"),
    ],
)
def test_lists_that_cannot_be_read(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(CorpusError, match=words):
        recordings_in(tmp_path / name)


def test_files_that_macos_leaves_beside_are_passed_over(tmp_path):
    for name in ("a.wav", "._a.wav", ".b.flac"):
        (tmp_path / name).write_bytes(SPEECH.read_bytes())
    assert [r.id for r in recordings_in(tmp_path)] == ["a"]
    with tarfile.open(tmp_path / "c.tar", "w") as tar:
        tar.add(tmp_path / "._a.wav", "s/._one.wav")
        tar.add(tmp_path / "a.wav", "s/one.wav")
    assert [r.id for r in recordings_in(tmp_path / "c.tar")] == ["s/one"]
