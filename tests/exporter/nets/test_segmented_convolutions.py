"""The convolutions of wav2vec 2.0 in segments, the first with its norm as one product."""

import dataclasses

import pytest
import torch

from facecode_exporter.nets.wav2vec2 import Wav2Vec2
from facecode_spec.systems import SYSTEMS

TINY = SYSTEMS["codetalker-tiny"].speech_encoder
FORMS = {
    "base": {"feat_extract_norm": "group"},
    "large": {"feat_extract_norm": "layer", "conv_bias": True},
}


@pytest.fixture(scope="module", params=FORMS)
def encoder(request):
    torch.manual_seed(5)
    form = TINY.architecture | FORMS[request.param]
    encoder = Wav2Vec2(dataclasses.replace(TINY, architecture=form), fps=30.0).eval()
    for name, parameter in encoder.feature_extractor.named_parameters():
        if "layer_norm" in name:  # norms start at the identity
            parameter.data += torch.randn(parameter.shape) / 4
    return encoder


@torch.no_grad()
@pytest.mark.parametrize("n_samples", [400, 719, 720, 1040, 1361, 2000, 9077, 48000])
def test_features_are_those_of_one_pass(encoder, n_samples):
    audio = torch.randn(2, n_samples, generator=torch.Generator().manual_seed(n_samples))
    audio[1] = audio[1] / 100 + 0.5  # a quiet clip with an offset
    want = encoder.feature_extractor(audio)
    got = Wav2Vec2.for_export(encoder).feature_extractor(audio)
    torch.testing.assert_close(got, want, rtol=1e-4, atol=2e-5)


@torch.no_grad()
def test_silence_gives_numbers(encoder):
    silence = torch.zeros(1, 1600)
    got = Wav2Vec2.for_export(encoder).feature_extractor(silence)
    torch.testing.assert_close(got, encoder.feature_extractor(silence), rtol=1e-4, atol=2e-5)


def test_the_network_keeps_its_layers(encoder):
    layers = list(encoder.feature_extractor.conv_layers)
    assert Wav2Vec2.for_export(encoder) is not encoder
    assert list(encoder.feature_extractor.conv_layers) == layers
