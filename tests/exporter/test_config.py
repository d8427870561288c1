import json

import pytest
import yaml
from conftest import DATA

from facecode_exporter.config import system_from_config, with_encoder_config
from facecode_exporter.errors import ConfigError
from facecode_spec.systems import SYSTEMS

VOCASET = DATA / "codetalker-vocaset-tiny"
BIWI = DATA / "codetalker-biwi-tiny"


def changed(tmp_path, case=VOCASET, **fields):
    sections = yaml.safe_load((case / "config.yaml").read_text())
    for section in sections.values():
        for key in set(section) & set(fields):
            section[key] = fields[key]
            if fields[key] is None:
                del section[key]
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump(sections))
    return file


def test_the_two_forms():
    vocaset = system_from_config(VOCASET / "config.yaml", VOCASET / "wav2vec2.json")
    assert (vocaset.n_vertices, vocaset.fps, vocaset.styles[:2]) == (120, 30, ("s0", "s1"))
    assert vocaset.parts[0].cross_modal_decoder.dim_feedforward == 192
    assert vocaset.speech_encoder.architecture["num_hidden_layers"] == 1
    biwi = system_from_config(BIWI / "config.yaml")
    assert biwi.speech_encoder.frame_grid == "pairs"
    assert biwi.parts[0].motion_decoder.input_projection
    assert not biwi.parts[0].motion_decoder.output_bias
    assert biwi.speech_encoder.architecture == {}


def test_the_autoencoder_may_be_that_of_the_other_form(tmp_path):
    system = system_from_config(changed(tmp_path, autoencoder="stage1_BIWI"))
    assert system.parts[0].motion_decoder.input_projection
    assert system.speech_encoder.frame_grid == "interpolate"


def test_affine_norm(tmp_path):
    system = system_from_config(changed(tmp_path, INaffine=True))
    assert system.parts[0].motion_decoder.norm_affine


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"quant_factor": 1}, "quant_factor is 1; only 0 is supported"),
        ({"dataset": "meshtalk"}, "expected one of vocaset, BIWI"),
        ({"autoencoder": "stage1_mine"}, "expected one of stage1_vocaset, stage1_BIWI"),
        ({"n_embed": None}, "n_embed is missing"),
        ({"period": "x"}, "period is 'x'; expected a number"),
        ({"num_layers": 2.5}, "expected a whole number"),
        ({"in_dim": 361}, "same multiple of 3"),
        ({"zquant_dim": 17}, "8 codes of 17 numbers make 136"),
        ({"n_head": 5}, "does not divide into 5 heads"),
    ],
)
def test_mistakes(tmp_path, fields, message):
    with pytest.raises(ConfigError, match=message):
        system_from_config(changed(tmp_path, **fields))


@pytest.mark.parametrize("text", ["", "[1]", "a: b: c", "DATA: 1", "\0"])
def test_not_a_configuration(tmp_path, text):
    file = tmp_path / "config.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError):
        system_from_config(file)
    with pytest.raises(ConfigError):
        system_from_config(tmp_path / "none.yaml")


def test_wav2vec2_config_keeps_what_differs(tmp_path):
    file = tmp_path / "config.json"
    file.write_text(
        json.dumps({
            "model_type": "wav2vec2", "architectures": ["Wav2Vec2Model"], "hidden_size": 768,
            "num_hidden_layers": 4, "transformers_version": "4.6.1", "gradient_checkpointing": True,
        })
    )  # fmt: skip
    system = with_encoder_config(SYSTEMS["codetalker-biwi"], file)
    assert system.speech_encoder.architecture == {"num_hidden_layers": 4}
    assert system.speech_encoder.min_samples == 720


@pytest.mark.parametrize("text", ["", "[]", '{"model_type": "hubert"}', '{"conv_stride": [5]}'])
def test_other_json(tmp_path, text):
    file = tmp_path / "config.json"
    file.write_text(text)
    with pytest.raises(ConfigError):
        with_encoder_config(SYSTEMS["codetalker-biwi"], file)


@pytest.mark.parametrize(
    "name",
    ["n_embed", "face_quan_num", "zquant_dim", "feature_dim", "num_layers", "n_head", "period",
     "hidden_size", "num_hidden_layers", "num_attention_heads", "intermediate_size", "in_dim",
     "vertice_dim", "quant_factor", "neg"],
)  # fmt: skip
@pytest.mark.parametrize(
    "value", [0, -1, 1e18, 10**400, float("inf"), float("nan"), "x", [1], {}, True, 2.5]
)
def test_sizes_that_are_none(tmp_path, name, value):
    """Each is one clear line, or a system that can be built; nothing else."""
    file = changed(tmp_path, **{name: value})
    if name in ("quant_factor", "neg") and value == 0:
        system_from_config(file)
        return
    with pytest.raises(ConfigError) as caught:
        system_from_config(file)
    assert len(str(caught.value)) < 600
    assert str(file) in str(caught.value)


@pytest.mark.parametrize(
    ("subjects", "styles"),
    [
        ("a b", ("a", "b")),
        (["a", "b"], ("a", "b")),
        (["a b", "c"], ("a b", "c")),
        *((bad, None) for bad in ("", [], [1, 2], ["a", "a"], "a a", {"a": 1}, 7, [["a"]], [""])),
    ],
)
def test_train_subjects(tmp_path, subjects, styles):
    file = changed(tmp_path, train_subjects=subjects)
    if styles is None:
        with pytest.raises(ConfigError, match="train_subjects"):
            system_from_config(file)
    else:
        assert system_from_config(file).styles == styles


def test_null_subjects(tmp_path):
    text = (VOCASET / "config.yaml").read_text()
    file = tmp_path / "config.yaml"
    file.write_text(yaml.safe_dump({**(s := yaml.safe_load(text)), "DATA": {**s["DATA"],
        "train_subjects": None}}))  # fmt: skip
    with pytest.raises(ConfigError, match="train_subjects is None"):
        system_from_config(file)


def test_networks_that_no_machine_holds(tmp_path):
    with pytest.raises(ConfigError, match="make a network of"):
        system_from_config(changed(tmp_path, n_embed=900_000, num_layers=900_000))
