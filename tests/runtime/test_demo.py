"""The packaged model: there, small, exact to its export, and worth a first command."""

import numpy as np
import pytest
from conftest import SPEECH

import facecode
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.errors import StyleError


@pytest.fixture(scope="module")
def face():
    return facecode.load()


def test_size_and_card():
    files = [f for f in PACKAGED_BUNDLE.rglob("*") if f.is_file()]
    assert sum(f.stat().st_size for f in files) <= 25_000_000
    assert "Limits" in (PACKAGED_BUNDLE / "MODEL_CARD.md").read_text()


def test_export_was_exact():
    parity = Bundle.open(PACKAGED_BUNDLE).manifest.parity
    assert all(case.n_codes == case.n_codes_equal for case in parity.cases)


def test_styles_and_identities(face):
    assert len(face.styles) >= 6
    assert len(face.manifest.identities) >= 3
    with pytest.raises(StyleError, match="nearest: lively"):
        face.animate(SPEECH, "livly")


def test_mix_moves_the_mouth_by_an_amount_in_between(face):
    """The mean opening of mixes between two styles goes from one to the other (Fig. 5)."""
    upper, lower = face.manifest.lip_pair

    def opening(style):
        vertices = face.animate(SPEECH, style).vertices
        return np.linalg.norm(vertices[:, upper] - vertices[:, lower], axis=1).mean()

    small, large = opening("mumbling"), opening("precise")
    middle = opening({"mumbling": 0.5, "precise": 0.5})
    assert small < middle < large


def test_silence_after_speech_keeps_the_mouth_shut(face, speech):
    samples = np.concatenate([speech[0], np.zeros(16_000, np.float32)])
    clip = face.animate(samples)
    upper, lower = face.manifest.lip_pair
    gap = np.linalg.norm(clip.vertices[:, upper] - clip.vertices[:, lower], axis=1)
    assert gap[-25:].max() < 0.003  # metres; open vowels reach 0.015


def test_demo_command(run_cli, tmp_path):
    done = run_cli("demo")
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [str(tmp_path / "demo.npz"), str(tmp_path / "demo.mp4")]
    assert (tmp_path / "demo.mp4").stat().st_size > 100_000
