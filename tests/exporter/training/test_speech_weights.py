"""Pretrained speech encoders of either family, from Hugging Face folders."""

import pytest
import torch
from transformers import Wav2Vec2Model, WhisperModel

from facecode_exporter.errors import CheckpointError
from facecode_exporter.nets.speech import family_of, speech_encoder
from facecode_exporter.training.speech_weights import load_pretrained
from facecode_spec.systems import SYSTEMS

WHISPER_DECODER = {"decoder_layers": 1, "decoder_attention_heads": 2, "decoder_ffn_dim": 16}
CASES = {"codetalker-tiny": (Wav2Vec2Model, {}), "codetalker-demo": (WhisperModel, WHISPER_DECODER)}


@pytest.fixture(params=CASES)
def system(request):
    return SYSTEMS[request.param]


@pytest.fixture
def folder(system, tmp_path):
    model, more = CASES[system.name]
    config = family_of(system).hugging_face(**system.speech_encoder.architecture, **more)
    torch.manual_seed(3)
    model(config).save_pretrained(tmp_path / "published")
    return tmp_path / "published"


def test_every_weight_is_the_published_one(system, folder):
    encoder = speech_encoder(system)
    load_pretrained(encoder, family_of(system), folder)
    published = family_of(system).pretrained(folder)
    for name, weight in encoder.state_dict().items():
        if name != "masked_spec_embed":  # never used
            assert torch.equal(weight, published[name]), name


def test_another_size_is_refused(system, folder):
    encoder = speech_encoder(system)
    encoder.register_parameter("more", torch.nn.Parameter(torch.zeros(1)))
    with pytest.raises(CheckpointError, match="more and 0 more; give its config"):
        load_pretrained(encoder, family_of(system), folder)


def test_the_folder_of_another_family_is_refused(system, folder):
    other = SYSTEMS["codetalker-demo" if system.name == "codetalker-tiny" else "codetalker-tiny"]
    with pytest.raises(CheckpointError):
        load_pretrained(speech_encoder(other), family_of(other), folder)


def test_no_folder(system, tmp_path):
    with pytest.raises(CheckpointError, match="no config"):
        load_pretrained(speech_encoder(system), family_of(system), tmp_path)
