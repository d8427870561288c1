"""The arrays of a bundle and its manifest, out of a trained system and a neutral face."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np

from facecode.arrays import Faces
from facecode.bundle_files import file_sha256
from facecode.clip import Rig
from facecode.rig_file import write_rig
from facecode.session import Compute, Graph
from facecode_exporter.bundles.graph_set import SystemGraph, graph_set
from facecode_exporter.bundles.neutral import Neutral
from facecode_exporter.bundles.rig_projection import rig_projection
from facecode_exporter.nets.networks import Network
from facecode_exporter.nets.part import PartNet
from facecode_spec.entries import FileEntry, PartEntry, ReachEntry
from facecode_spec.graphs import DECODER_STEP, MOTION_DECODER, OPSET, VERTEX_HEAD, part_file
from facecode_spec.manifest import (
    FORMAT_VERSION,
    MANIFEST_NAME,
    Manifest,
    ModeEntry,
    RigEntry,
    SourceEntry,
)
from facecode_spec.schema import PartSpec, SystemSpec

LICENCE = (
    "The weights keep the licence of the checkpoints named under 'sources'. Models trained on "
    "VOCASET or BIWI are for non-commercial research, as those data sets are."
)
CODEBOOK, VERTICES, PROJECTION = "codebook", "vertices", "rig_projection"
TEMPLATE = "template.npy"
FACES, COLOURS, RIG = "faces.npy", "colours.npy", "rig.npz"
DEFAULT_WINDOW = 8
"""Frames decoded at a step until the export has chosen a width."""
DELAY = 30
"""Frames after which `window` gives a frame: half of the deviation of 15, 1.5 x that of 60."""
MODES = {
    "exact": ModeEntry(look_ahead_ms=None, delay_frames=None),
    "window": ModeEntry(look_ahead_ms=None, delay_frames=DELAY, window=DEFAULT_WINDOW),
}
CAUSAL_MODES = {"exact": ModeEntry(look_ahead_ms=None, delay_frames=0)}
"""Of a system without codes: a frame is final when it is predicted."""


def write_arrays(net: Network, folder: Path, neutral: Neutral) -> None:
    """Write codebooks, vertex indices and the face itself into `folder`."""
    for part in net.part_nets:
        if isinstance(part, PartNet):
            codebook = part.autoencoder.quantize.embedding.weight.detach().numpy()
            np.save(folder / _array_file(net.system, part.part, CODEBOOK), codebook)
        if part.part.n_vertices is not None:
            own = neutral.parts[part.part.name].astype(np.int32)
            np.save(folder / _array_file(net.system, part.part, VERTICES), own)
    np.save(folder / TEMPLATE, neutral.vertices.astype(np.float32))
    if neutral.faces is not None:
        np.save(folder / FACES, neutral.faces)
    if neutral.colours is not None:
        np.save(folder / COLOURS, neutral.colours)
    if neutral.rig is not None:
        _write_rig(net.system, folder, neutral, neutral.rig)
    for name, indices in neutral.regions.items():
        np.save(folder / _region_file(name), indices.astype(np.int32))
    for name, vertices in neutral.identities.items():
        np.save(folder / _identity_file(name), vertices.astype(np.float32))


def _write_rig(system: SystemSpec, folder: Path, neutral: Neutral, rig: Rig) -> None:
    """The face units, and what gives weights of them from the hidden frames of each part."""
    with (folder / RIG).open("wb") as file:
        write_rig(rig, file)
    for graph in graph_set(system):
        if graph.part is not None and graph.spec.name == VERTEX_HEAD:
            head = Graph(folder / graph.file, graph.entry, Compute(threads=1))
            n_hidden = int(graph.entry.input("hidden").axes[2])
            own = neutral.parts.get(graph.part.name)
            projection = rig_projection(head, n_hidden, rig.deltas, own)
            np.save(folder / _array_file(system, graph.part, PROJECTION), projection)


def _array_file(system: SystemSpec, part: PartSpec, name: str) -> str:
    return f"{part_file(system, part, name)}.npy"


def _region_file(name: str) -> str:
    return f"region-{name}.npy"


def _identity_file(name: str) -> str:
    return f"identity-{name}.npy"


def manifest_of(
    net: Network,
    folder: Path,
    neutral: Neutral,
    sources: Mapping[str, Path],
    licence: str,
) -> Manifest:
    """The manifest of the files in `folder`, before anything is measured."""
    system = net.system
    graphs = graph_set(system)
    return Manifest(
        format_version=FORMAT_VERSION,
        name=system.name,
        family=system.family,
        reference=system.reference,
        fps=system.fps,
        sample_rate=system.speech_encoder.sample_rate,
        normalise_audio=system.speech_encoder.normalise,
        min_samples=system.speech_encoder.min_samples,
        n_vertices=system.n_vertices,
        unit=system.unit,
        metres_per_unit=system.metres_per_unit,
        up_axis=system.up_axis,
        styles=system.styles,
        modes=MODES if any(part.kind == "codes" for part in system.parts) else CAUSAL_MODES,
        precision="fp32",
        template=TEMPLATE,
        has_template=neutral.given,
        faces=None if neutral.faces is None else FACES,
        colours=None if neutral.colours is None else COLOURS,
        regions={name: _region_file(name) for name in neutral.regions},
        lip_pair=neutral.lip_pair,
        identities={name: _identity_file(name) for name in neutral.identities},
        rig=None if neutral.rig is None else RigEntry(neutral.rig.names, RIG),
        topology=None if neutral.faces is None else topology(neutral.faces),
        speech_encoder=graphs[0].entry,
        parts=tuple(
            _part_entry(system, part, graphs, neutral.rig is not None) for part in system.parts
        ),
        files=files_of(folder),
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


def _part_entry(
    system: SystemSpec, part: PartSpec, graphs: Sequence[SystemGraph], has_rig: bool
) -> PartEntry:
    own = {graph.spec.name: graph.entry for graph in graphs if graph.part == part}
    reach = None if part.motion_decoder is None else part.motion_decoder.kernel // 2
    return PartEntry(
        name=part.name,
        kind=part.kind,
        decoder_step=own[DECODER_STEP],
        vertex_head=own[VERTEX_HEAD],
        codebook=None if part.codebook is None else _array_file(system, part, CODEBOOK),
        motion_decoder=own.get(MOTION_DECODER),
        reach=None if reach is None else ReachEntry(before=reach, after=reach),
        n_samples=part.n_samples,
        conditions_on=part.conditions_on,
        vertices=None if part.n_vertices is None else _array_file(system, part, VERTICES),
        rig_projection=_array_file(system, part, PROJECTION) if has_rig else None,
    )


def files_of(folder: Path) -> dict[str, FileEntry]:
    """Size and hash of every file in `folder` but the manifest."""
    return {
        file.name: FileEntry(file.stat().st_size, file_sha256(file))
        for file in sorted(folder.iterdir())
        if file.name != MANIFEST_NAME
    }


def topology(faces: Faces) -> str:
    """Fingerprint of a mesh's triangles."""
    return hashlib.sha256(np.ascontiguousarray(faces, dtype="<i4").tobytes()).hexdigest()
