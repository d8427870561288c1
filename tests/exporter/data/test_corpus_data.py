"""A generated corpus scored like any data set, and mixes of styles."""

import json

import numpy as np
import pytest
import soundfile
from conftest import SPEECH

import facecode
from facecode.audio import load_audio
from facecode.bundle import PACKAGED_BUNDLE
from facecode_exporter.cli.main import main
from facecode_exporter.corpus.files import load_corpus_head
from facecode_exporter.data.corpus_data import open_data_set
from facecode_exporter.errors import CorpusError, DataSetError
from facecode_exporter.evaluation.style_mix import mix_styles
from facecode_exporter.head.head import PACKAGED


@pytest.fixture
def corpus(tmp_path):
    """Two clips in the layout of `facecode-export corpus`, a second each."""
    rng = np.random.default_rng(0)
    for kind in ("wav", "weights"):
        (tmp_path / kind).mkdir()
    speech = load_audio(SPEECH, 16_000)
    for i, name in enumerate(("calm_00009", "lively_00009")):
        weights = rng.random((30, 52)).astype(np.float16) / 4
        np.save(tmp_path / "weights" / f"{name}.npy", weights)
        soundfile.write(tmp_path / "wav" / f"{name}.flac", speech[16_000 * i :][:16_000], 16_000)
    (tmp_path / "head.npz").write_bytes(PACKAGED.read_bytes())
    splits = {"train": [], "val": ["calm_00009"], "test": ["calm_00009", "lively_00009"]}
    (tmp_path / "splits.json").write_text(json.dumps(splits))
    return tmp_path


def test_a_corpus_is_a_data_set(corpus):
    data = open_data_set(corpus, "corpus")
    assert data.clips == ("calm_00009", "lively_00009")
    head = load_corpus_head(corpus)
    weights = np.load(corpus / "weights" / "calm_00009.npy")
    np.testing.assert_allclose(
        data.truth("calm_00009"), head.offsets(weights) + head.template, atol=1e-6
    )
    assert data.speech("calm_00009").is_file()
    assert open_data_set(corpus, "corpus", "val").clips == ("calm_00009",)


def test_what_a_corpus_lacks_is_said(corpus, tmp_path):
    with pytest.raises(DataSetError, match="train"):
        open_data_set(corpus, "corpus", "train")
    with pytest.raises(DataSetError, match="expected one of test"):
        open_data_set(corpus, "corpus", "none")
    with pytest.raises(CorpusError, match="missing"):
        open_data_set(corpus, "corpus").speech("calm_00019")
    with pytest.raises(CorpusError):
        open_data_set(tmp_path / "nothing", "corpus")


def test_the_packaged_model_is_scored_on_a_corpus(corpus, capsys):
    bundle = str(PACKAGED_BUNDLE)
    assert main(["evaluate", "bundle", bundle, "--data", str(corpus), "--dataset", "corpus"]) == 0
    assert "codes in use: face" in capsys.readouterr().out


def test_a_mix_opens_the_mouth_in_between(tmp_path, capsys):
    face = facecode.load()
    mix = mix_styles(face, SPEECH, ("mumbling", "precise"), face.manifest.lip_pair, n_mixes=3)
    assert list(mix.means) == sorted(mix.means)
    assert [len(curve) for curve in mix.openings] == [len(mix.openings[0])] * 3
    pytest.importorskip("matplotlib", reason="needs the extra plots")
    plot = tmp_path / "mix.png"
    assert main(["evaluate", "mix", "--styles", "calm,lively", "--plot", str(plot)]) == 0
    assert plot.stat().st_size > 10_000
    assert main(["evaluate", "mix", "--styles", "calm"]) == 2
    assert "expected two" in capsys.readouterr().err
