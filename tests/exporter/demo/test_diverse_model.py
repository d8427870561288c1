"""The diverse model's recipe: each part's coefficients are its motion, lifting changes nothing."""

import json

import numpy as np
import pytest
import torch

from facecode_exporter.demo.coefficients import CorpusClips, MotionBasis
from facecode_exporter.demo.diverse_model import lifted, on_coefficients, query_config
from facecode_exporter.head.division import part_vertices
from facecode_exporter.head.face_units import unit_weights
from facecode_exporter.head.head import PACKAGED, load_head
from facecode_exporter.random_weights import random_network
from facecode_spec.systems.cdface_demo import SPEC


@pytest.fixture(scope="module")
def head():
    return load_head()


@pytest.fixture(scope="module")
def bases(head):
    spread = np.full(52, 0.2, np.float32)
    return {name: MotionBasis(head, spread, own) for name, own in part_vertices(head).items()}


@pytest.fixture(scope="module")
def weights():
    return np.random.default_rng(0).random((9, 52)).astype(np.float32) / 2


@pytest.fixture(scope="module")
def nets(bases):
    small = random_network(on_coefficients(SPEC, bases), seed=2)
    return small, lifted(small, bases, SPEC)


def test_coefficients_of_a_part_hold_all_of_its_motion(head, bases, weights):
    offsets = head.offsets(weights)
    for name, own in part_vertices(head).items():
        coefficients = torch.from_numpy(bases[name].coefficients(weights)).double()
        assert coefficients.shape == (9, 3 * bases[name].n_vertices)
        back = (coefficients @ bases[name].decode.T).numpy().reshape(9, -1, 3)
        np.testing.assert_allclose(back, offsets[:, own], atol=1e-6)
    assert bases["upper_face"].n_vertices < 18  # units that leave it still cost nothing


def test_lifted_layers_compute_what_the_small_ones_do(head, bases, weights, nets):
    offsets = head.offsets(weights)
    for small, full in zip(nets[0].part_nets, nets[1].part_nets, strict=True):
        name = full.part.name
        own = torch.from_numpy(offsets[:, part_vertices(head)[name]].reshape(9, -1))
        coefficients = torch.from_numpy(bases[name].coefficients(weights))
        with torch.no_grad():
            torch.testing.assert_close(
                full.vertice_map(own), small.vertice_map(coefficients), rtol=0, atol=5e-3
            )
            hidden = torch.randn(4, full.part.motion_decoder.dim)
            moved = small.autoencoder.decoder.vertice_map_reverse(hidden).double()
            got = full.autoencoder.decoder.vertice_map_reverse(hidden).double()
        torch.testing.assert_close(got, moved @ bases[name].decode.T, rtol=0, atol=1e-4)


def test_weights_are_float16_values(nets):
    for name, parameter in nets[1].named_parameters():
        assert torch.equal(parameter.half().float(), parameter), name


def test_clips_know_when_the_mouth_is_open(tmp_path, bases):
    """A closed half and a jaw that opens, in the layout of a corpus."""
    motion = np.zeros((20, 52), np.float16)
    motion[10:] = np.linspace(0, 1, 10)[:, None] * unit_weights(jawOpen=0.5)
    (tmp_path / "weights").mkdir()
    np.save(tmp_path / "weights" / "calm_00000.npy", motion)
    (tmp_path / "head.npz").write_bytes(PACKAGED.read_bytes())
    (tmp_path / "splits.json").write_text(json.dumps({"train": ["calm_00000"]}))
    clips = CorpusClips(tmp_path, "train", bases["lips"], SPEC.styles)
    (is_open,) = clips.open_mouth(0.15)
    assert not is_open[:11].any()
    assert is_open[13:].all()


def test_every_part_has_a_configuration(tmp_path):
    for part in SPEC.parts:
        config = query_config(tmp_path, part.name)
        assert (config.part, config.fine_tune_speech) == (part.name, False)
        assert config.losses.mask
