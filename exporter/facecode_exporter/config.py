"""The public configurations of CodeTalker and FaceFormer, and a speech encoder's config.json.

They become a SystemSpec.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from facecode_exporter.errors import ConfigError
from facecode_exporter.nets.speech import family_of, samples_for
from facecode_exporter.system_size import n_numbers
from facecode_spec.plain import SpecError
from facecode_spec.schema import (
    CodebookSpec,
    CrossModalDecoderSpec,
    PartSpec,
    SystemSpec,
)
from facecode_spec.systems import (
    codetalker_biwi,
    codetalker_vocaset,
    faceformer_biwi,
    faceformer_vocaset,
)

# The public code has two frame grids, named by DATA.dataset, and two VQ autoencoders, named by
# NETWORK.autoencoder; as published they go together.
FORMS = {"vocaset": codetalker_vocaset.SPEC, "BIWI": codetalker_biwi.SPEC}
ONE_FILE_FORMS = {"vocaset": faceformer_vocaset.SPEC, "BIWI": faceformer_biwi.SPEC}
AUTOENCODERS = {f"stage1_{dataset}": system.parts[0] for dataset, system in FORMS.items()}
MOST_NUMBERS = 4_000_000_000  # in the networks of a system: 16 GB
# Fields of a Hugging Face file that say where it came from, not what the network is.
PROVENANCE = {"_name_or_path", "architectures", "dtype", "torch_dtype", "transformers_version"}


def system_from_config(config: Path, wav2vec2_config: Path | None = None) -> SystemSpec:
    """The system that a public `config/{vocaset,BIWI}/*.yaml` of CodeTalker describes.

    A file without sections holds options of FaceFormer's command line: dataset, vertice_dim,
    feature_dim, period, train_subjects.

    Raises:
        ConfigError: unreadable, a field missing, or a form that is not supported.
    """
    fields, has_sections = _flat_fields(config)
    forms = FORMS if has_sections else ONE_FILE_FORMS
    form = forms.get(str(_need(fields, "dataset", config)))
    if form is None:
        raise ConfigError(
            f"{config}: dataset is {fields['dataset']!r}; expected one of {', '.join(FORMS)}"
        )
    try:
        system = (_codetalker if has_sections else _faceformer)(fields, form, config)
        _check_size(system, config)
    except SpecError as error:
        raise ConfigError(f"{config}: {error}") from error
    return system if wav2vec2_config is None else with_encoder_config(system, wav2vec2_config)


def _check_size(system: SystemSpec, config: Path) -> None:
    if (n := n_numbers(system)) > MOST_NUMBERS:
        raise ConfigError(
            f"{config}: these sizes make a network of {n:,} numbers; expected no more than "
            f"{MOST_NUMBERS:,}"
        )


def _codetalker(fields: Mapping[str, Any], form: SystemSpec, config: Path) -> SystemSpec:
    if _whole(fields, "quant_factor", config) != 0:
        raise ConfigError(
            f"{config}: quant_factor is {fields['quant_factor']}; only 0 is supported, since other "
            "values stride over time, which neither published model does. Export a stage 1 trained "
            "with quant_factor 0"
        )
    return dataclasses.replace(
        form,
        n_vertices=_vertices(fields, config),
        styles=_subjects(fields, config),
        parts=(_part(fields, _autoencoder_form(fields, form, config), config),),
    )


def _faceformer(fields: Mapping[str, Any], form: SystemSpec, config: Path) -> SystemSpec:
    width = _whole(fields, "vertice_dim", config)
    if not width or width % 3:
        raise ConfigError(f"{config}: vertice_dim is {width}; expected a multiple of 3")
    dim, (part,) = _whole(fields, "feature_dim", config), form.parts
    decoder = dataclasses.replace(
        part.cross_modal_decoder,  # one layer and four heads, whatever the options say
        dim=dim,
        dim_feedforward=2 * dim,
        period=_whole(fields, "period", config),
    )
    return dataclasses.replace(
        form,
        n_vertices=width // 3,
        styles=_subjects(fields, config),
        parts=(dataclasses.replace(part, cross_modal_decoder=decoder),),
    )


def with_encoder_config(system: SystemSpec, config: Path) -> SystemSpec:
    """`system` with the speech encoder of a Hugging Face config.json.

    Raises:
        ConfigError: unreadable, or of another family than the speech encoder of `system`.
    """
    family = family_of(system).hugging_face
    kind = family.model_type
    try:
        given = json.loads(_read(config))
    except ValueError as error:
        raise ConfigError(f"{config}: not JSON: {error}") from error
    if not isinstance(given, dict) or given.get("model_type", kind) != kind:
        raise ConfigError(f"{config}: expected a Hugging Face configuration of type {kind}")
    defaults = family().to_dict()
    architecture = {
        key: value
        for key, value in given.items()
        if key not in PROVENANCE and key in defaults and value != defaults[key]
    }
    encoder = dataclasses.replace(system.speech_encoder, architecture=architecture)
    try:
        min_samples = samples_for(encoder, system.fps, 1)
    except Exception as error:  # transformers wraps what it refuses in classes of its own
        raise ConfigError(f"{config}: {error}") from error
    encoder = dataclasses.replace(encoder, min_samples=min_samples)
    return dataclasses.replace(system, speech_encoder=encoder)


def _autoencoder_form(fields: Mapping[str, Any], form: SystemSpec, config: Path) -> PartSpec:
    name = fields.get("autoencoder")
    if name is None:
        return form.parts[0]
    if name not in AUTOENCODERS:
        raise ConfigError(
            f"{config}: autoencoder is {name!r}; expected one of {', '.join(AUTOENCODERS)}"
        )
    return AUTOENCODERS[name]


def _part(fields: Mapping[str, Any], form: PartSpec, config: Path) -> PartSpec:
    def whole(key: str) -> int:
        return _whole(fields, key, config)

    _, decoder = form.prior
    return dataclasses.replace(
        form,
        codebook=CodebookSpec(whole("n_embed"), whole("face_quan_num"), whole("zquant_dim")),
        cross_modal_decoder=CrossModalDecoderSpec(
            dim=whole("feature_dim"),
            n_layers=whole("num_layers"),
            n_heads=whole("n_head"),
            dim_feedforward=2 * whole("feature_dim"),
            period=whole("period"),
        ),
        motion_decoder=dataclasses.replace(
            decoder,
            dim=whole("hidden_size"),
            n_layers=whole("num_hidden_layers"),
            n_heads=whole("num_attention_heads"),
            dim_feedforward=whole("intermediate_size"),
            negative_slope=_number(fields, "neg", config),
            norm_affine=bool(_need(fields, "INaffine", config)),
        ),
    )


def _subjects(fields: Mapping[str, Any], config: Path) -> tuple[str, ...]:
    """Names in a line, as published, or as a list of YAML."""
    given = _need(fields, "train_subjects", config)
    names = given.split() if isinstance(given, str) else given
    if (
        not isinstance(names, list)
        or not names
        or not all(isinstance(name, str) and name for name in names)
        or len(set(names)) < len(names)
    ):
        raise ConfigError(
            f"{config}: train_subjects is {given!r}; expected different names, in a line or a list"
        )
    return tuple(names)


def _vertices(fields: Mapping[str, Any], config: Path) -> int:
    width, decoder_width = _whole(fields, "in_dim", config), _whole(fields, "vertice_dim", config)
    if width != decoder_width or width % 3:
        raise ConfigError(
            f"{config}: in_dim is {width} and vertice_dim {decoder_width}; "
            "expected the same multiple of 3"
        )
    return width // 3


def _flat_fields(config: Path) -> tuple[dict[str, Any], bool]:
    """All fields, and whether they stand in sections, as CodeTalker's do."""
    try:
        sections = yaml.safe_load(_read(config))
    except yaml.YAMLError as error:
        raise ConfigError(f"{config}: not YAML: {error}") from error
    parts = list(sections.values()) if isinstance(sections, dict) else []
    if parts and not any(isinstance(part, dict) for part in parts):
        return sections, False
    if not parts or not all(isinstance(part, dict) for part in parts):
        raise ConfigError(
            f"{config}: expected the sections DATA, NETWORK, VQuantizer, PREDICTOR of CodeTalker, "
            "or the options of FaceFormer without any"
        )
    return {key: value for part in parts for key, value in part.items()}, True


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error


def _need(fields: Mapping[str, Any], key: str, config: Path) -> object:
    if key not in fields:
        raise ConfigError(f"{config}: {key} is missing")
    return fields[key]


def _number(fields: Mapping[str, Any], key: str, config: Path) -> float:
    value = _need(fields, key, config)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ConfigError(f"{config}: {key} is {value!r}; expected a number")
    return float(value) if -1e300 < value < 1e300 else math.inf  # 1 with 400 noughts is no float


def _whole(fields: Mapping[str, Any], key: str, config: Path) -> int:
    value = _number(fields, key, config)
    if not value.is_integer() or not 0 <= value <= MOST_NUMBERS:
        raise ConfigError(
            f"{config}: {key} is {fields[key]}; expected a whole number of 0 to {MOST_NUMBERS:,}"
        )
    return int(value)
