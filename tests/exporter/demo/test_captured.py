"""Captured speech joins a corpus of generated speech, and leaves it in order."""

import json

import numpy as np
import pytest
import soundfile
from tracked_mouths import write_mouth_tracks

from facecode_exporter.corpus.files import (
    clip_names,
    load_clip_audio,
    load_phones,
    load_voice,
    load_weights,
)
from facecode_exporter.corpus.writing import write_generated, write_json
from facecode_exporter.data.mouth_tracks import read_mouth_tracks
from facecode_exporter.demo.captured import add_captured, teacher_weights
from facecode_exporter.errors import CorpusError
from facecode_exporter.head.face_units import UNIT
from facecode_exporter.head.head import load_head

N_CLIPS = 7  # number 0 is for validation, 5 for the test, the rest for training


@pytest.fixture(scope="module")
def people(tmp_path_factory, speech):
    folder = tmp_path_factory.mktemp("people")
    write_mouth_tracks(folder, N_CLIPS, *speech)
    return folder


@pytest.fixture
def corpus(tmp_path):
    """A corpus without clips, but for the names of two."""
    folder = tmp_path / "corpus"
    for kind in ("wav", "phones", "text", "weights"):
        (folder / kind).mkdir(parents=True)
    write_json(folder / "corpus.json", {"format": 1})
    write_generated(folder, ["calm_00000", "lively_00008"])
    return folder


def test_clips_are_whole_and_stay_in_their_splits(people, corpus):
    assert add_captured(people, corpus, progress=False) == 6
    train, val = clip_names(corpus, "train"), clip_names(corpus, "val")
    assert train == ["calm_00000", *(f"natural_{50_000 + i}" for i in range(5))]
    assert val == ["lively_00008", "natural_50005"]
    assert clip_names(corpus, "test") == []
    paces = set()
    for name in train[1:]:
        weights, audio = load_weights(corpus, name), load_clip_audio(corpus, name)
        assert weights.shape[1] == 52
        assert 0 <= len(audio) / 16_000 * 30 - len(weights) < 1.01
        assert load_phones(corpus, name)[-1].end_s == pytest.approx(len(audio) / 16_000, abs=1e-3)
        assert load_voice(corpus, name) == "s1"
        assert weights[:, UNIT["jawOpen"]].max() > 0.1
        paces.add(len(weights))
    assert len(paces) > 1, "some are played faster or slower"


def test_run_again_it_changes_nothing_and_generated_clips_join(people, corpus):
    add_captured(people, corpus, progress=False)
    before = {p: p.read_bytes() for p in sorted(corpus.rglob("*")) if p.is_file()}
    add_captured(people, corpus, progress=False)
    assert before == {p: p.read_bytes() for p in sorted(corpus.rglob("*")) if p.is_file()}
    write_generated(corpus, ["calm_00000", "calm_00001"])
    splits = json.loads((corpus / "splits.json").read_text())
    assert splits["train"][:3] == ["calm_00000", "calm_00001", "natural_50000"]
    assert splits["val"] == ["natural_50005"]


def test_the_teacher_opens_the_head_as_the_person_did(people):
    (track, *_), head = read_mouth_tracks(people, "train"), load_head()
    weights = teacher_weights(track, head)
    assert len(weights) == 24
    opening = 1000 * (head.opening(weights) - head.opening(np.zeros((1, 52))))
    assert opening[:4] == pytest.approx(np.zeros(4), abs=0.6)
    assert opening[-2] == pytest.approx(np.interp(22 / 30, [5.5 / 25, 19.5 / 25], [0, 12]), abs=0.4)
    fast = teacher_weights(track, head, pace=1.25)
    assert len(fast) == 19
    assert np.abs(fast[16] - weights[20]).max() < 0.05


def test_without_a_corpus_nothing_is_written(people, tmp_path):
    with pytest.raises(CorpusError, match="corpus"):
        add_captured(people, tmp_path, progress=False)
    assert not any(tmp_path.iterdir())


def test_at_the_command_line(people, corpus, capsys):
    from facecode_exporter.cli.main import main

    arguments = ["captured-corpus", "--data", str(people), "--corpus", str(corpus), "--quiet"]
    assert main(arguments) == 0
    assert "6 clips of tracked speech" in capsys.readouterr().out
    assert soundfile.info(corpus / "wav" / "natural_50000.flac").samplerate == 16_000
    assert main([*arguments[:-2], str(corpus / "nothing")]) == 2
