"""A trained system to a bundle folder, reopened and compared before it gets its name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from torch import nn
from tqdm import tqdm

from facecode.animator import Animator
from facecode.arrays import AnyArray, Colours, Faces, Indices
from facecode.audio import SPEECH, load_audio
from facecode.bundle import Bundle
from facecode.session import Graph
from facecode.template import load_template, read_mesh
from facecode_exporter import parity
from facecode_exporter.checkpoints import file_sha256
from facecode_exporter.deviation import Motion, choose_window, deviation, move, require_small
from facecode_exporter.graphs import export_graph
from facecode_exporter.motion_view import MotionDecoderView
from facecode_exporter.nets.cdface import Trained
from facecode_exporter.nets.speech import samples_for
from facecode_exporter.output_folder import replacing
from facecode_exporter.quantize import quantise_file
from facecode_exporter.speech_view import SpeechEncoderView
from facecode_exporter.views import DecoderStepView, VertexHeadView
from facecode_spec.graphs import (
    OPSET,
    SPEECH_ENCODER,
    GraphSpec,
    decoder_step,
    motion_decoder,
    part_file,
    part_graphs,
    speech_encoder,
    vertex_head,
)
from facecode_spec.manifest import (
    FORMAT_VERSION,
    MANIFEST_NAME,
    FileEntry,
    GraphEntry,
    Manifest,
    ParityReport,
    PartEntry,
    SourceEntry,
)
from facecode_spec.schema import PartSpec, SystemSpec

Precision: TypeAlias = Literal["fp32", "int8"]
LICENCE = (
    "The weights keep the licence of the checkpoints named under 'sources'. Models trained on "
    "VOCASET or BIWI are for non-commercial research, as those data sets are."
)
CODEBOOK, VERTICES = "codebook", "vertices"
TEMPLATE = "template.npy"
FACES, COLOURS = "faces.npy", "colours.npy"


@dataclass(frozen=True)
class Neutral:
    """The neutral face that goes into a bundle; faces and colours where they are known."""

    vertices: AnyArray
    """(V, 3)"""
    faces: Faces | None = None
    """(F, 3) int32"""
    colours: Colours | None = None
    """(V, 3) uint8 RGB"""
    regions: Mapping[str, Indices] = field(default_factory=dict)
    """vertex indices (n,) int32"""
    lip_pair: tuple[int, int] | None = None
    identities: Mapping[str, AnyArray] = field(default_factory=dict)
    """further templates (V, 3)"""
    parts: Mapping[str, Indices] = field(default_factory=dict)
    """vertex indices (n,) of each part of the face, for systems of several"""
    given: bool = True


def read_neutral(template: Path | None, n_vertices: int) -> Neutral:
    """The template of a mesh file, or zeros when none is given.

    Raises:
        TemplateError
    """
    if template is None:
        return Neutral(np.zeros((n_vertices, 3), np.float32), given=False)
    vertices, faces = read_mesh(template)
    return Neutral(load_template(vertices, n_vertices), faces)


def views_of(net: Trained) -> list[tuple[GraphSpec, nn.Module]]:
    """Every graph of the system with the module that computes it, part by part."""
    system = net.system
    views: list[tuple[GraphSpec, nn.Module]] = [(speech_encoder(system), SpeechEncoderView(net))]
    for part in net.part_nets:
        views += [
            (decoder_step(system, part.part), DecoderStepView(part)),
            (motion_decoder(part.part), MotionDecoderView(part)),
            (vertex_head(system, part.part), VertexHeadView(part)),
        ]
    return views


def graph_files(system: SystemSpec) -> list[str]:
    """File names of the graphs, in the order of `views_of`."""
    names = [
        part_file(system, part, g.name) for part in system.parts for g in part_graphs(system, part)
    ]
    return [f"{name}.onnx" for name in (SPEECH_ENCODER, *names)]


def write_bundle(
    net: Trained,
    out: Path,
    neutral: Neutral,
    sources: Mapping[str, Path],
    progress: bool = False,
    licence: str = LICENCE,
    precision: Precision = "fp32",
    any_deviation: bool = False,
) -> Manifest:
    """Export `net` to the folder `out`; on any failure `out` is as it was before.

    Raises:
        OutputExistsError, OutputFolderError, ParityError.
        DeviationError: int8 changes the motion too much, unless `any_deviation`.
    """
    with (
        replacing(out, MANIFEST_NAME) as folder,
        tqdm(total=3 * len(net.part_nets) + 3, desc="export", disable=not progress) as bar,
    ):
        views = views_of(net)
        for (spec, view), file in zip(views, graph_files(net.system), strict=True):
            bar.set_postfix_str(file)
            export_graph(view, spec, folder / file)
            bar.update()
        _write_arrays(net, folder, neutral)
        manifest = _manifest(net, folder, neutral, sources, licence)
        _write_manifest(folder, manifest)
        bar.set_postfix_str("parity")
        manifest = replace(manifest, parity=check_bundle(net, folder, views))
        bar.update()
        bar.set_postfix_str("deviation")
        _write_manifest(folder, manifest)
        exact = move(Animator(Bundle.open(folder)))
        if precision == "int8":
            manifest, exact = _quantise(folder, manifest, exact, any_deviation)
        window = choose_window(Animator(Bundle.open(folder)), exact)
        manifest = replace(manifest, window=window)
        _write_manifest(folder, manifest)
        bar.update()
    return manifest


def _quantise(
    folder: Path, manifest: Manifest, exact: Motion, any_deviation: bool
) -> tuple[Manifest, Motion]:
    """Give the graphs of a float32 bundle int8 weights; `exact` is its motion.

    Raises:
        DeviationError
    """
    for file in graph_files(manifest.system):
        quantise_file(folder / file)
    manifest = replace(manifest, precision="int8", files=_files(folder))
    _write_manifest(folder, manifest)
    animator = Animator(Bundle.open(folder))
    motion = move(animator)
    found = deviation(animator, exact, motion)
    if not any_deviation:
        require_small(found)
    return replace(manifest, quantisation=found), motion


def check_bundle(
    net: Trained, folder: Path, views: list[tuple[GraphSpec, nn.Module]]
) -> ParityReport:
    """Reopen the bundle with the runtime and compare it with torch.

    Raises:
        ParityError
    """
    animator = Animator(Bundle.open(folder))
    errors = parity.compare_graphs(
        [(s, v, g) for (s, v), g in zip(views, graphs_of(animator), strict=True)]
    )
    cases = [parity.compare_clip(net, animator, case) for case in parity_cases(net)]
    parity.require_parity(cases)
    return parity.report(errors, cases)


def graphs_of(animator: Animator) -> list[Graph]:
    """The loaded graphs of an animator, in the order of `views_of`."""
    parts = [(p.decoder_step, p.motion.graph, p.vertex_head) for p in animator.parts]
    return [animator.speech_encoder.graph, *(graph for part in parts for graph in part)]


def parity_cases(net: Trained) -> Iterator[parity.Case]:
    """Real speech, 1, 2 and 3 frames long and past the period, each in another style.

    Where parts have several samples, short clips take all of them and the last two of each; with
    several parts a further case holds the first one.
    """
    system = net.system
    speech = load_audio(SPEECH, system.speech_encoder.sample_rate)
    styles = np.eye(len(system.styles), dtype=np.float32)
    mix = np.full(len(system.styles), 1 / len(system.styles), dtype=np.float32)
    longest = max(part.cross_modal_decoder.period for part in system.parts) + 7
    every = {part.name: part.n_samples for part in system.parts}
    two = {name: min(n, 2) for name, n in every.items()}
    for i, (n_frames, samples) in enumerate(
        zip((1, 2, 3, longest), (every, every, every, two), strict=True)
    ):
        n_samples = samples_for(system.speech_encoder, system.fps, n_frames)
        start = 4000 * i
        weights = mix if n_frames == longest else styles[i % len(styles)]
        yield parity.Case(speech[start : start + n_samples], weights, samples)
    if len(system.parts) > 1:
        first, n_samples = system.parts[0], samples_for(system.speech_encoder, system.fps, 5)
        codes = np.random.default_rng(0).integers(
            0, first.codebook.n_codes, (5, first.codebook.codes_per_frame)
        )
        held = {name: n for name, n in two.items() if name != first.name}
        yield parity.Case(speech[:n_samples], mix, held, {first.name: codes})


def _write_arrays(net: Trained, folder: Path, neutral: Neutral) -> None:
    for part in net.part_nets:
        codebook = part.autoencoder.quantize.embedding.weight.detach().numpy()
        np.save(folder / _array_file(net.system, part.part, CODEBOOK), codebook)
        if len(net.part_nets) > 1:
            own = neutral.parts[part.part.name].astype(np.int32)
            np.save(folder / _array_file(net.system, part.part, VERTICES), own)
    np.save(folder / TEMPLATE, neutral.vertices.astype(np.float32))
    if neutral.faces is not None:
        np.save(folder / FACES, neutral.faces)
    if neutral.colours is not None:
        np.save(folder / COLOURS, neutral.colours)
    for name, indices in neutral.regions.items():
        np.save(folder / _region_file(name), indices.astype(np.int32))
    for name, vertices in neutral.identities.items():
        np.save(folder / _identity_file(name), vertices.astype(np.float32))


def _array_file(system: SystemSpec, part: PartSpec, name: str) -> str:
    return f"{part_file(system, part, name)}.npy"


def _region_file(name: str) -> str:
    return f"region-{name}.npy"


def _identity_file(name: str) -> str:
    return f"identity-{name}.npy"


def _write_manifest(folder: Path, manifest: Manifest) -> None:
    (folder / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")


def _manifest(
    net: Trained,
    folder: Path,
    neutral: Neutral,
    sources: Mapping[str, Path],
    licence: str,
) -> Manifest:
    system = net.system
    return Manifest(
        format_version=FORMAT_VERSION,
        name=system.name,
        reference=system.reference,
        fps=system.fps,
        sample_rate=system.speech_encoder.sample_rate,
        normalise_audio=system.speech_encoder.normalise,
        min_samples=system.speech_encoder.min_samples,
        n_vertices=system.n_vertices,
        unit=system.unit,
        styles=system.styles,
        look_ahead_ms=None,
        precision="fp32",
        template=TEMPLATE,
        has_template=neutral.given,
        faces=None if neutral.faces is None else FACES,
        colours=None if neutral.colours is None else COLOURS,
        regions={name: _region_file(name) for name in neutral.regions},
        lip_pair=neutral.lip_pair,
        identities={name: _identity_file(name) for name in neutral.identities},
        topology=None if neutral.faces is None else topology(neutral.faces),
        speech_encoder=GraphEntry.of(f"{SPEECH_ENCODER}.onnx", speech_encoder(system)),
        parts=tuple(_part_entry(system, part) for part in system.parts),
        files=_files(folder),
        system=system,
        opset=OPSET,
        exported_with={
            name: version(name) for name in ("facecode", "torch", "onnx", "transformers")
        },
        sources={
            stage: SourceEntry(path.name, file_sha256(path)) for stage, path in sources.items()
        },
        licence=licence,
    )


def _part_entry(system: SystemSpec, part: PartSpec) -> PartEntry:
    step, motion, head = (
        GraphEntry.of(f"{part_file(system, part, spec.name)}.onnx", spec)
        for spec in part_graphs(system, part)
    )
    return PartEntry(
        part.name,
        _array_file(system, part, CODEBOOK),
        *(step, motion, head),
        part.n_samples,
        part.conditions_on,
        _array_file(system, part, VERTICES) if len(system.parts) > 1 else None,
    )


def _files(folder: Path) -> dict[str, FileEntry]:
    return {
        file.name: FileEntry(file.stat().st_size, file_sha256(file))
        for file in sorted(folder.iterdir())
        if file.name != MANIFEST_NAME
    }


def topology(faces: Faces) -> str:
    """Fingerprint of a mesh's triangles."""
    return hashlib.sha256(np.ascontiguousarray(faces, dtype="<i4").tobytes()).hexdigest()
