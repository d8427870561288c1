"""A trained system to a bundle folder, reopened and compared before it gets its name."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

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
from facecode_exporter.graphs import export_graph
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.nets.speech import samples_for
from facecode_exporter.output_folder import replacing
from facecode_exporter.views import (
    DecoderStepView,
    MotionDecoderView,
    SpeechEncoderView,
    VertexHeadView,
)
from facecode_spec.graphs import (
    OPSET,
    GraphSpec,
    decoder_step,
    motion_decoder,
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

LICENCE = (
    "The weights keep the licence of the checkpoints named under 'sources'. Models trained on "
    "VOCASET or BIWI are for non-commercial research, as those data sets are."
)
CODEBOOK, TEMPLATE = "codebook.npy", "template.npy"
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


def views_of(net: CodeTalker) -> list[tuple[GraphSpec, nn.Module]]:
    """Every graph of the system with the module that computes it."""
    system, part = net.system, net.part
    return [
        (speech_encoder(system), SpeechEncoderView(net)),
        (decoder_step(system, part), DecoderStepView(net)),
        (motion_decoder(part), MotionDecoderView(net)),
        (vertex_head(system, part), VertexHeadView(net)),
    ]


def write_bundle(
    net: CodeTalker,
    out: Path,
    neutral: Neutral,
    sources: Mapping[str, Path],
    progress: bool = False,
    licence: str = LICENCE,
) -> Manifest:
    """Export `net` to the folder `out`; on any failure `out` is as it was before.

    Raises:
        OutputExistsError, OutputFolderError, ParityError.
    """
    with (
        replacing(out, MANIFEST_NAME) as folder,
        tqdm(total=6, desc="export", disable=not progress) as bar,
    ):
        views = views_of(net)
        for spec, view in views:
            bar.set_postfix_str(spec.name)
            export_graph(view, spec, folder / f"{spec.name}.onnx")
            bar.update()
        _write_arrays(net, folder, neutral)
        manifest = _manifest(net, folder, neutral, sources, licence)
        _write_manifest(folder, manifest)
        bar.set_postfix_str("parity")
        manifest = replace(manifest, parity=check_bundle(net, folder, views))
        bar.update()
        _write_manifest(folder, manifest)
        bar.update()
    return manifest


def check_bundle(
    net: CodeTalker, folder: Path, views: list[tuple[GraphSpec, nn.Module]]
) -> ParityReport:
    """Reopen the bundle with the runtime and compare it with torch.

    Raises:
        ParityError
    """
    animator = Animator(Bundle.open(folder))
    graphs = {g.name: g for g in graphs_of(animator)}
    errors = parity.compare_graphs([(s, v, graphs[s.name]) for s, v in views])
    cases = [parity.compare_clip(net, animator, case) for case in parity_cases(net)]
    parity.require_parity(cases)
    return parity.report(errors, cases)


def graphs_of(animator: Animator) -> list[Graph]:
    """The loaded graphs of an animator."""
    (part,) = animator.parts
    return [
        animator.speech_encoder,
        part.decoder_step,
        part.motion_decoder,
        part.vertex_head,
    ]


def parity_cases(net: CodeTalker) -> Iterator[parity.Case]:
    """Real speech, 1, 2 and 3 frames long and past the period, each in another style."""
    system = net.system
    speech = load_audio(SPEECH, system.speech_encoder.sample_rate)
    styles = np.eye(len(system.styles), dtype=np.float32)
    mix = np.full(len(system.styles), 1 / len(system.styles), dtype=np.float32)
    lengths = (1, 2, 3, net.part.cross_modal_decoder.period + 7)
    for i, n_frames in enumerate(lengths):
        n_samples = samples_for(system.speech_encoder, system.fps, n_frames)
        start = 4000 * i
        weights = mix if i == len(lengths) - 1 else styles[i % len(styles)]
        yield parity.Case(speech[start : start + n_samples], weights)


def _write_arrays(net: CodeTalker, folder: Path, neutral: Neutral) -> None:
    codebook = net.autoencoder.quantize.embedding.weight.detach().numpy()
    np.save(folder / CODEBOOK, codebook)
    np.save(folder / TEMPLATE, neutral.vertices.astype(np.float32))
    if neutral.faces is not None:
        np.save(folder / FACES, neutral.faces)
    if neutral.colours is not None:
        np.save(folder / COLOURS, neutral.colours)
    for name, indices in neutral.regions.items():
        np.save(folder / _region_file(name), indices.astype(np.int32))
    for name, vertices in neutral.identities.items():
        np.save(folder / _identity_file(name), vertices.astype(np.float32))


def _region_file(name: str) -> str:
    return f"region-{name}.npy"


def _identity_file(name: str) -> str:
    return f"identity-{name}.npy"


def _write_manifest(folder: Path, manifest: Manifest) -> None:
    (folder / MANIFEST_NAME).write_text(manifest.to_json(), encoding="utf-8")


def _manifest(
    net: CodeTalker,
    folder: Path,
    neutral: Neutral,
    sources: Mapping[str, Path],
    licence: str,
) -> Manifest:
    system, part = net.system, net.part

    def graph(spec: GraphSpec) -> GraphEntry:
        return GraphEntry.of(f"{spec.name}.onnx", spec)

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
        speech_encoder=graph(speech_encoder(system)),
        parts=(
            PartEntry(
                part.name,
                CODEBOOK,
                graph(decoder_step(system, part)),
                graph(motion_decoder(part)),
                graph(vertex_head(system, part)),
            ),
        ),
        files={
            file.name: FileEntry(file.stat().st_size, file_sha256(file))
            for file in sorted(folder.iterdir())
        },
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


def topology(faces: Faces) -> str:
    """Fingerprint of a mesh's triangles."""
    return hashlib.sha256(np.ascontiguousarray(faces, dtype="<i4").tobytes()).hexdigest()
