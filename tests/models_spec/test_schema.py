import dataclasses
import json

import pytest
from conftest import TINY, TINY_FACEFORMER

from facecode_spec.manifest import Manifest, NewerFormatError
from facecode_spec.plain import SpecError, from_plain, to_plain
from facecode_spec.schema import PartSpec, SystemSpec
from facecode_spec.systems import SYSTEMS

MANIFEST = (TINY / "manifest.json").read_text()


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_survive_json(name):
    spec = SYSTEMS[name]
    assert from_plain(SystemSpec, json.loads(json.dumps(to_plain(spec)))) == spec
    assert name == spec.name


def test_published_sizes():
    vocaset, biwi = SYSTEMS["codetalker-vocaset"], SYSTEMS["codetalker-biwi"]
    assert (vocaset.n_vertices, vocaset.fps, len(vocaset.styles)) == (5023, 30, 8)
    assert (biwi.n_vertices, biwi.fps, len(biwi.styles)) == (23370, 25, 6)
    assert biwi.speech_encoder.memory_rows_per_frame == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"colour": 1}, "unknown key 'colour'"),
        ({"fps": "30"}, "fps: expected float"),
        ({"n_vertices": True}, "n_vertices: expected int"),
        ({"parts": []}, "has no part"),
        ({"styles": ["a", "a"]}, "different names"),
    ],
)
def test_strict_reading(change, message):
    plain = {**to_plain(SYSTEMS["codetalker-tiny"]), **change}
    with pytest.raises(SpecError, match=message):
        from_plain(SystemSpec, plain)


def test_missing_key_and_nested_path():
    plain = to_plain(SYSTEMS["codetalker-tiny"])
    del plain["parts"][0]["codebook"]["dim"]
    with pytest.raises(SpecError, match=r"parts\[0\].codebook: missing key dim"):
        from_plain(SystemSpec, plain)


def test_inconsistent_widths_are_refused():
    part = SYSTEMS["codetalker-tiny"].parts[0]
    with pytest.raises(SpecError, match="4 codes of 9 numbers make 36"):
        dataclasses.replace(part, codebook=dataclasses.replace(part.codebook, dim=9))
    with pytest.raises(SpecError, match="does not divide into 5 heads"):
        PartSpec(
            "face",
            part.codebook,
            dataclasses.replace(part.cross_modal_decoder, n_heads=5),
            part.motion_decoder,
        )


def test_kinds_go_with_the_family():
    codes, offsets = SYSTEMS["codetalker-tiny"], SYSTEMS["faceformer-tiny"]
    assert (codes.parts[0].kind, offsets.parts[0].kind) == ("codes", "offsets")
    assert (codes.parts[0].hidden_dim, offsets.parts[0].hidden_dim) == (32, 32)
    with pytest.raises(SpecError, match="not of kind 'codes', as those of the family codetalker"):
        dataclasses.replace(codes, parts=offsets.parts)
    with pytest.raises(SpecError, match="not of kind 'offsets'"):
        dataclasses.replace(offsets, parts=codes.parts)
    with pytest.raises(SpecError, match="2 parts; the family faceformer has one"):
        dataclasses.replace(offsets, parts=offsets.parts * 2)
    with pytest.raises(SpecError, match="expected one sample, and no condition"):
        dataclasses.replace(offsets.parts[0], n_samples=2)


def test_the_published_sizes_of_faceformer():
    vocaset, biwi = SYSTEMS["faceformer-vocaset"], SYSTEMS["faceformer-biwi"]
    assert (vocaset.n_vertices, vocaset.fps) == (5023, 30)
    assert (biwi.n_vertices, biwi.fps) == (23370, 25)
    assert vocaset.styles == SYSTEMS["codetalker-vocaset"].styles
    assert biwi.styles == SYSTEMS["codetalker-biwi"].styles
    decoders = [system.parts[0].cross_modal_decoder for system in (vocaset, biwi)]
    assert [(d.dim, d.n_layers, d.n_heads, d.dim_feedforward, d.period) for d in decoders] == [
        (64, 1, 4, 128, 30),
        (128, 1, 4, 256, 25),
    ]


def test_manifest_survives_json():
    manifest = Manifest.from_json(MANIFEST)
    assert Manifest.from_json(manifest.to_json()) == manifest
    assert manifest.to_json() == MANIFEST


def test_a_part_conditions_on_codes_before_it():
    manifest = Manifest.from_json(MANIFEST)
    (first,) = manifest.parts
    second = dataclasses.replace(first, name="more", conditions_on=("face",))
    assert dataclasses.replace(manifest, parts=(first, second))
    for parts in ((second,), (second, first)):
        with pytest.raises(SpecError, match=r"conditions on \['face'\]; expected parts of kind"):
            dataclasses.replace(manifest, parts=parts)
    silent = Manifest.from_json((TINY_FACEFORMER / "manifest.json").read_text()).parts[0]
    with pytest.raises(SpecError, match="expected parts of kind 'codes' before it"):
        dataclasses.replace(manifest, parts=(silent, second))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("", SpecError),
        ("[]", SpecError),
        ("{}", SpecError),
        ('{"format_version": true}', SpecError),
        ('{"format_version": 2}', NewerFormatError),
        (MANIFEST.replace('"precision"', '"precisoin"'), SpecError),
    ],
)
def test_bad_manifests(text, error):
    with pytest.raises(error):
        Manifest.from_json(text)
