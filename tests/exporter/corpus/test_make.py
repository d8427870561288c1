"""A small corpus, made, interrupted, resumed and read."""

import argparse
import json
import shutil

import numpy as np
import pytest

from facecode_exporter.cli.demo import add_parser
from facecode_exporter.corpus.files import (
    SUFFIXES,
    clip_names,
    clip_path,
    load_about,
    load_clip_audio,
    load_corpus_head,
    load_offsets,
    load_phones,
    load_voice,
    load_weights,
)
from facecode_exporter.corpus.styles import STYLES
from facecode_exporter.corpus.utterance import NOBODY, SHARE_WITHOUT_SPEECH, make_utterance
from facecode_exporter.errors import CorpusError
from facecode_exporter.measures.lip_sync import count_lip_sync

pytest.importorskip("pocketsphinx", reason="needs the extra corpus")
pytest.importorskip("hibari", reason="needs the extra corpus")

from facecode_exporter.corpus import make as corpus_module
from facecode_exporter.corpus.make import make_corpus

MINUTES = 0.5


@pytest.fixture(scope="module")
def corpus(tmp_path_factory):
    out = tmp_path_factory.mktemp("demo") / "corpus"
    make_corpus(out, MINUTES, seed=5, progress=False)
    return out


def contents(folder):
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def test_a_clip_has_sound_labels_phones_and_text(corpus):
    name = next(n for n in clip_names(corpus, "train") if load_voice(corpus, n) != NOBODY)
    audio, weights, phones = (f(corpus, name) for f in (load_clip_audio, load_weights, load_phones))
    assert weights.dtype == np.float16
    assert weights.shape == (len(audio) * 30 // 16000, 52)
    assert (phones[0].start_s, phones[-1].end_s) == (0, pytest.approx(len(audio) / 16000))
    assert clip_path(corpus, "text", name).read_text().strip().endswith((".", "?", "!"))
    offsets = load_offsets(corpus, name)
    assert offsets.dtype == np.float32
    assert offsets.shape == (len(weights), *load_corpus_head(corpus).template.shape)


def test_clips_are_named_after_styles(corpus):
    styles = {style.name for style in STYLES}
    names = clip_names(corpus, "train")
    assert {name.split("_")[0] for name in names} <= styles
    assert set(load_about(corpus)["styles"]) == styles


def test_voices_for_the_test_are_not_heard_in_training(corpus):
    voices = load_about(corpus)["voices"]
    heard = {load_voice(corpus, name) for name in clip_names(corpus, "train")} - {NOBODY}
    assert heard
    assert not [name for name in heard if voices[name]["held_out"]]


def test_some_recordings_have_no_speech(monkeypatch):
    assert 0 < SHARE_WITHOUT_SPEECH < 0.2
    monkeypatch.setattr("facecode_exporter.corpus.utterance.SHARE_WITHOUT_SPEECH", 1.0)
    for number in range(12):
        said = make_utterance((5, 0, number), "train", None, [], [])
        assert (said.text, said.voice, [p.name for p in said.phones]) == ("", NOBODY, ["SIL"])
        assert 1.4 < len(said.audio) / 16_000 == said.phones[0].end_s < 12.1
        assert np.isfinite(said.audio).all()
        assert np.abs(said.audio).max() <= 1


def test_styles_share_some_utterances_and_move_differently(corpus):
    first, second = clip_names(corpus, "train")[:2]
    np.testing.assert_array_equal(load_clip_audio(corpus, first), load_clip_audio(corpus, second))
    assert np.abs(load_weights(corpus, first) - load_weights(corpus, second)).max() > 0.02


def test_interrupted_and_resumed_is_the_same_as_made_at_once(corpus, tmp_path, monkeypatch):
    out, write, written = tmp_path / "corpus", corpus_module.write_clip, []

    def interrupted(*args):
        if len(written) == 2:
            raise KeyboardInterrupt
        written.append(args)
        write(*args)

    monkeypatch.setattr(corpus_module, "write_clip", interrupted)
    with pytest.raises(KeyboardInterrupt):
        make_corpus(out, MINUTES, seed=5, progress=False)
    assert len(clip_names(out, "train")) == 2
    monkeypatch.undo()
    make_corpus(out, MINUTES, seed=5, progress=False)
    assert contents(out) == contents(corpus)


def test_finished_clips_are_not_made_again(corpus, monkeypatch):
    monkeypatch.setattr(corpus_module, "write_clip", None)
    before = contents(corpus)
    report = make_corpus(corpus, MINUTES, seed=5, progress=False)
    assert contents(corpus) == before
    assert report.seconds >= 60 * MINUTES
    assert report.lip_sync.closed >= 0.98 * report.lip_sync.n_closures
    # One utterance in nine styles: its closest vowel stays under the bar in four of them.
    assert report.lip_sync.n_openings - report.lip_sync.opened <= 4
    head, name = load_corpus_head(corpus), "natural_00000"
    rest = float(head.opening(np.zeros((1, 52)))[0])
    opening = head.opening(load_weights(corpus, name))
    natural = count_lip_sync(load_phones(corpus, name), opening, rest, 30.0)
    assert natural.opened == natural.n_openings == 5


def test_another_seed_is_refused(corpus):
    with pytest.raises(CorpusError, match="made with other seed"):
        make_corpus(corpus, MINUTES, seed=6, progress=False)


def test_a_folder_with_something_else_is_refused(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(CorpusError, match=r"holds no corpus\.json"):
        make_corpus(tmp_path, MINUTES, progress=False)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_damage_is_named(corpus, tmp_path):
    broken = shutil.copytree(corpus, tmp_path / "broken")
    name = clip_names(broken, "train")[0]
    clip_path(broken, "weights", name).write_bytes(b"\x93NUMPY")
    with pytest.raises(CorpusError, match=f"{name}.npy"):
        load_weights(broken, name)
    (broken / "corpus.json").write_text(json.dumps({"format": 99}))
    with pytest.raises(CorpusError, match="format 1"):
        load_about(broken)
    with pytest.raises(CorpusError, match="no split 'dev'"):
        clip_names(broken, "dev")
    with pytest.raises(CorpusError, match="facecode-export corpus"):
        clip_names(tmp_path, "train")


def test_nothing_half_written_is_left(corpus):
    kinds = {"corpus.json", "splits.json", "head.npz", *SUFFIXES}
    assert {path.name for path in corpus.iterdir()} == kinds
    assert not list(corpus.rglob(".*"))


def test_the_command_line_makes_a_corpus(tmp_path, capsys):
    parser = argparse.ArgumentParser()
    add_parser(parser.add_subparsers())
    args = parser.parse_args(["corpus", "--out", str(tmp_path / "c"), "--minutes", "0.05"])
    args.quiet = True
    args.run(args)
    assert "P B M closed 100.0 %" in capsys.readouterr().out
    args.minutes = -1.0
    with pytest.raises(CorpusError, match="more than 0"):
        args.run(args)
