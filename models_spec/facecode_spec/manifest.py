"""The bundle's manifest.json: everything a runtime must know before it opens a graph.

A runtime reads the top level alone. `system` is the exporter's own description, echoed for people
and tools; `parity` is what the exporter measured.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from facecode_spec.graphs import GraphSpec
from facecode_spec.schema import SpecError, SystemSpec, from_plain, to_plain

FORMAT_VERSION = 1
MANIFEST_NAME = "manifest.json"


class NewerFormatError(SpecError):
    """The bundle was written by a later release in a format that this one does not know."""


@dataclass(frozen=True)
class FileEntry:
    """Size in bytes and SHA-256 (hexadecimal) of one file of the bundle."""

    size: int
    sha256: str


@dataclass(frozen=True)
class TensorEntry:
    """One input or output of a graph; axes are names, or numbers written as text."""

    name: str
    dtype: str
    axes: tuple[str, ...]


@dataclass(frozen=True)
class GraphEntry:
    """One graph file with its signature."""

    path: str
    inputs: tuple[TensorEntry, ...]
    outputs: tuple[TensorEntry, ...]

    @classmethod
    def of(cls, path: str, spec: GraphSpec) -> GraphEntry:
        """The entry of a graph with signature `spec` at `path`."""

        def entries(tensors: tuple[Any, ...]) -> tuple[TensorEntry, ...]:
            return tuple(TensorEntry(t.name, t.dtype, tuple(map(str, t.axes))) for t in tensors)

        return cls(path, entries(spec.inputs), entries(spec.outputs))


@dataclass(frozen=True)
class PartEntry:
    """The files of one part of the face, in the order in which parts are animated."""

    name: str
    codebook: str
    decoder_step: GraphEntry
    motion_decoder: GraphEntry
    vertex_head: GraphEntry
    n_samples: int = 1
    """Samples for each sample of the parts before it; the input `sample` picks one."""
    conditions_on: tuple[str, ...] = ()
    """Earlier parts whose code vectors of the frame are inputs `condition_<part>`."""
    vertices: str | None = None
    """int32 (n,) indices of the part's vertices, in the order of its offsets; null: all."""


@dataclass(frozen=True)
class SourceEntry:
    """A checkpoint file that the weights came from."""

    file: str
    sha256: str


@dataclass(frozen=True)
class ParityCase:
    """Runtime against torch for one clip length."""

    n_frames: int
    n_codes: int
    n_codes_equal: int
    max_vertex_error: float
    min_code_margin: float
    """Smallest relative distance gap between the nearest and the second-nearest code."""


@dataclass(frozen=True)
class ParityReport:
    """What the exporter measured when it reopened the bundle with the runtime."""

    vertex_tolerance: float
    graph_errors: Mapping[str, float]
    """Largest absolute difference to the torch network for each graph output."""
    cases: tuple[ParityCase, ...]


@dataclass(frozen=True)
class Deviation:
    """How far one way of computing is from another, over all frames of the calibration audio."""

    n_frames: int
    code_agreement: float
    """Share of codes that are equal, 0 to 1."""
    lip_deviation: float
    """Lip vertex error between the two, as a share of that between the face and its rest."""


@dataclass(frozen=True)
class WindowEntry:
    """The default of `window` mode."""

    frames: int
    """Frames decoded at a step."""
    deviation: Deviation
    """From `exact`."""


@dataclass(frozen=True)
class Manifest:
    """manifest.json as a value; see docs/bundle-format.md."""

    format_version: int
    name: str
    reference: str
    fps: float
    sample_rate: int
    normalise_audio: bool
    min_samples: int
    n_vertices: int
    unit: str
    styles: tuple[str, ...]
    look_ahead_ms: float | None
    """Audio after a frame that the frame depends on; null: the whole clip."""
    precision: str
    template: str
    faces: str | None
    colours: str | None
    """uint8 (V, 3) RGB per vertex, where the face has colours."""
    regions: Mapping[str, str]
    """int32 (n,) vertex indices by region name: `lips`, `upper_face`."""
    lip_pair: tuple[int, ...] | None
    """Upper and lower inner-lip vertex; their distance is the mouth opening."""
    identities: Mapping[str, str]
    """Further float32 (V, 3) templates by name."""
    topology: str | None
    """SHA-256 of the little-endian int32 (F, 3) face indices: equal for equal meshes."""
    speech_encoder: GraphEntry
    parts: tuple[PartEntry, ...]
    files: Mapping[str, FileEntry]
    system: SystemSpec
    opset: int
    exported_with: Mapping[str, str]
    sources: Mapping[str, SourceEntry]
    licence: str
    has_template: bool = True
    """False: no template was given at export; vertices are offsets from zero."""
    parity: ParityReport | None = None
    window: WindowEntry | None = None
    quantisation: Deviation | None = None
    """From float32, where `precision` is another."""

    def to_json(self) -> str:
        """The manifest as indented JSON with a final newline."""
        return json.dumps(to_plain(self), indent=1, ensure_ascii=False) + "\n"

    @classmethod
    def from_json(cls, text: str) -> Manifest:
        """Read a manifest strictly.

        Raises:
            SpecError: not JSON, or not this form.
            NewerFormatError: a format version above `FORMAT_VERSION`.
        """
        try:
            data = json.loads(text)
        except ValueError as error:
            raise SpecError(f"not JSON: {error}") from error
        version = data.get("format_version") if isinstance(data, dict) else None
        if not isinstance(version, int) or isinstance(version, bool) or version < 1:
            raise SpecError(f"format_version: expected a positive number, got {version!r}")
        if version > FORMAT_VERSION:
            raise NewerFormatError(
                f"bundle format {version}; this release reads up to {FORMAT_VERSION}"
            )
        return from_plain(cls, data, "manifest")
