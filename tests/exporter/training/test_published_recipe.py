"""What the public training code does beside the losses: dropout and the codebook's beginning."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch
from conftest import DATA

from facecode_exporter.config import system_from_config
from facecode_exporter.demo.model import stage1_config, stage2_config
from facecode_exporter.errors import RunError
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.nets.frame_grid import frames_of, to_motion
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_exporter.nets.wav2vec2 import Wav2Vec2, span_mask
from facecode_exporter.training import recipes
from facecode_exporter.training.config import stage1_defaults, stage2_defaults
from facecode_exporter.training.speech_rows import SpeechRows
from facecode_exporter.training.stage1 import Stage1
from facecode_spec.systems import SYSTEMS

SYSTEM = SYSTEMS["codetalker-demo"]


class TwoClips:
    """Motion alone."""

    names = ("a", "b")

    def offsets(self, index):
        generator = torch.Generator().manual_seed(index)
        return torch.randn(9, 3 * 40, generator=generator).numpy()


@pytest.fixture
def prior():
    part = dataclasses.replace(SYSTEM.parts[0], n_vertices=None)
    torch.manual_seed(0)
    return VQAutoencoder(part, 40)


def test_the_defaults_are_the_public_code_s():
    one, two = stage1_defaults("x", "d", True), stage2_defaults("x", "d")
    assert (one.position_dropout, one.small_codebook, two.decoder_dropout) == (0.1, True, 0.1)


def test_the_packaged_model_is_trained_without(tmp_path):
    one, two = stage1_config(tmp_path), stage2_config(tmp_path)
    assert (one.position_dropout, one.small_codebook, two.decoder_dropout) == (0.0, False, 0.0)


def test_positions_of_the_prior_are_dropped_in_training_alone(prior):
    offsets = torch.randn(1, 7, 120)
    vectors = torch.randn(1, 7, *prior.encoder.code_shape)
    with torch.no_grad():
        for side, x in ((prior.encoder, offsets), (prior.decoder, vectors)):
            plain = side.train()(x)
            assert torch.equal(plain, side(x))
            prior.drop(0.1)
            torch.testing.assert_close(side.eval()(x), plain, rtol=0, atol=0)
            side.train()
            assert not torch.allclose(side(x), side(x))
            before = side.embed(x) if side is prior.decoder else None
            if before is not None:
                share = float((before == 0).float().mean())
                assert share == pytest.approx(0.1, abs=0.05)
            prior.drop(0.0)


def test_a_small_codebook_begins_within_one_nth(prior, tmp_path):
    config = dataclasses.replace(stage1_defaults("x", "d", True), epochs=0)
    rows = prior.quantize.embedding.weight.detach()
    n, normal = len(rows), rows.clone()
    clips = (TwoClips(), TwoClips())
    other = dataclasses.replace(config, small_codebook=False)
    recipes.train_prior(prior, clips, other, tmp_path / "normal", False)
    assert torch.equal(rows, normal)
    recipes.train_prior(prior, clips, config, tmp_path / "small", False)
    assert float(rows.abs().max()) <= 1 / n
    assert float(rows.std()) == pytest.approx(2 / n / 12**0.5, rel=0.1)
    assert abs(float(rows.mean())) < 0.05 / n


def test_stages_set_the_shares_of_their_networks(prior):
    clips = (TwoClips(), TwoClips())
    Stage1(prior, *clips, stage1_defaults("x", "d", True))
    assert {prior.encoder.position_dropout.p, prior.decoder.position_dropout.p} == {0.1}


def test_the_decoder_drops_in_training_alone():
    torch.manual_seed(0)
    net = CodeTalker(SYSTEM)
    rows = SYSTEM.speech_encoder.memory_rows_per_frame
    dim = SYSTEM.parts[0].cross_modal_decoder.dim
    tokens, memory = torch.randn(1, 5, dim), torch.randn(1, 5 * rows, dim)
    with torch.no_grad():
        plain = net.train().hidden(tokens, memory)
        net.drop(0.1)
        torch.testing.assert_close(net.eval().hidden(tokens, memory), plain, rtol=0, atol=1e-5)
        net.train()
        assert not torch.allclose(net.hidden(tokens, memory), net.hidden(tokens, memory))


def encoder_of(form):
    """The tiny wav2vec 2.0 of a form, of fixed random weights, and its system."""
    case = DATA / f"codetalker-{form}-tiny"
    system = system_from_config(case / "config.yaml", case / "wav2vec2.json")
    torch.manual_seed(3)
    encoder = Wav2Vec2(system.speech_encoder, system.fps)
    torch.nn.init.normal_(encoder.masked_spec_embed)
    return encoder.eval(), system


AUDIO = torch.randn(1, 24_000, generator=torch.Generator().manual_seed(5))


def test_spans_are_masked_in_their_share_and_drawn_from_torch():
    torch.manual_seed(0)
    mask = span_mask(200, 400, 0.05)
    torch.manual_seed(0)
    assert torch.equal(mask, span_mask(200, 400, 0.05))
    assert mask.dtype == torch.bool
    assert 0.04 < float(mask.float().mean()) < 0.055  # two or three spans; some overlap
    assert int(span_mask(50, 20, 0.05).sum(dim=1).max()) <= 20
    assert all(int(row.sum()) >= 10 for row in span_mask(50, 20, 0.05))
    assert not span_mask(3, 9, 0.5).any()


def test_speech_is_disturbed_in_training_alone():
    encoder, _ = encoder_of("vocaset")
    with torch.no_grad():
        plain = encoder(AUDIO)
        for shares in ((0.05, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.1)):
            encoder.disturb(*shares)
            assert torch.equal(encoder.eval()(AUDIO), plain)
            encoder.train()
            for layer in encoder.modules():  # what acts without `disturb` too
                if isinstance(layer, torch.nn.Dropout) and layer is not encoder.input_dropout:
                    layer.eval()
            torch.manual_seed(0)
            said = [encoder(AUDIO) for _ in range(6)]
            assert any(not torch.allclose(said[0], other) for other in said[1:]), shares
            torch.manual_seed(0)
            assert all(torch.equal(encoder(AUDIO), before) for before in said)


def test_every_layer_may_be_left_out():
    encoder, system = encoder_of("vocaset")
    encoder.disturb(0.0, 1.0, 0.0)
    for layer in encoder.encoder.layers:
        layer.forward = None
    encoder.train()
    with torch.no_grad():
        assert encoder(AUDIO).shape[1] == frames_of(74, system.speech_encoder, 30.0)


@pytest.mark.parametrize("n_frames", [1, 20, 44, 51])
def test_features_are_stretched_to_motion(n_frames):
    """VOCASET: the ends meet, whatever the rates say."""
    encoder, system = encoder_of("vocaset")
    features = torch.randn(1, 74, 3, generator=torch.Generator().manual_seed(1))
    found = to_motion(features, system.speech_encoder, n_frames)[0]
    at = np.linspace(0, 73, n_frames) if n_frames > 1 else np.zeros(1)
    for channel in range(3):
        expected = np.interp(at, np.arange(74), features[0, :, channel])
        np.testing.assert_allclose(found[:, channel], expected, atol=1e-4)
    with torch.no_grad():
        assert encoder.aligned(AUDIO, n_frames).shape[:2] == (1, n_frames)


def test_the_grid_of_use_is_that_of_motion_as_long():
    encoder, _ = encoder_of("vocaset")
    with torch.no_grad():
        torch.testing.assert_close(encoder.aligned(AUDIO, 44), encoder(AUDIO), rtol=0, atol=1e-4)


def test_pairs_are_cut_before_the_transformer():
    encoder, _ = encoder_of("biwi")
    with torch.no_grad():
        whole = encoder(AUDIO)
        assert torch.equal(encoder.aligned(AUDIO, 99), whole)
        cut = encoder.aligned(AUDIO, 20)
    assert cut.shape[1] == 40
    assert not torch.allclose(cut, whole[:, :40], atol=1e-4)  # it has heard no more than that


class Spoken(TwoClips):
    """Motion of 50 and of 30 frames, speech of 24,000 samples."""

    def offsets(self, index):
        return np.zeros((50 - 20 * index, 120), np.float32)

    def audio(self, _):
        return AUDIO[0].numpy()


@pytest.mark.parametrize(("form", "lengths"), [("vocaset", [50, 30]), ("biwi", [37, 30])])
def test_clips_are_as_long_as_published(form, lengths):
    encoder, system = encoder_of(form)
    clips, config = Spoken(), stage2_defaults(system.name, "d")
    rows = SpeechRows(system, encoder, {"train": clips, "val": clips}, config, trained=True)
    assert rows.lengths == {"train": lengths, "val": lengths}
    n_rows = system.speech_encoder.memory_rows_per_frame
    for i, n in enumerate(lengths):
        assert rows.batch("val", [(i, 0, n)]).shape[1] == n * n_rows
    as_in_use = dataclasses.replace(config, aligned_speech=False)
    plain = SpeechRows(system, encoder, {"val": clips}, as_in_use, trained=True)
    assert plain.lengths == {"val": [44, 30] if form == "vocaset" else [37, 30]}


def test_another_family_is_refused():
    net = CodeTalker(SYSTEM)
    for field in ("mask_share", "layer_drop", "encoder_dropout", "aligned_speech"):
        config = dataclasses.replace(stage2_config(Path("c")), **{field: 1})
        with pytest.raises(RunError, match=r"of wav2vec 2\.0"):
            SpeechRows(SYSTEM, net.audio_encoder, {}, config, trained=True)
