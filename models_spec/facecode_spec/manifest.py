"""The bundle's manifest.json: everything a runtime must know before it opens a graph.

A runtime reads the top level alone. `system` is the exporter's own description, echoed for people
and tools; `parity` is what the exporter measured.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from facecode_spec.entries import FileEntry, GraphEntry, PartEntry
from facecode_spec.live import LiveEntry
from facecode_spec.plain import SpecError, from_plain, to_plain
from facecode_spec.schema import LARGEST, SystemSpec, UpAxis

FORMAT_VERSION = 1
MANIFEST_NAME = "manifest.json"
LONGEST_NAME = 255


class NewerFormatError(SpecError):
    """The bundle was written by a later release in a format that this one does not know."""


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
    min_code_margin: float | None
    """Smallest relative distance gap between the nearest and the second-nearest code; null: a
    system without codes."""


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
    code_agreement: float | None
    """Share of codes that are equal, 0 to 1; null: a system without codes."""
    lip_deviation: float
    """Lip vertex error between the two, as a share of that between the face and its rest."""


@dataclass(frozen=True)
class ModeEntry:
    """What a way of running the loop asks for and costs in quality."""

    look_ahead_ms: float | None
    """Audio after a frame that the frame depends on; null: the whole recording."""
    delay_frames: int | None
    """Frames that follow a frame before it is final; null: all."""
    window: int | None = None
    """Frames decoded at a step by default; null: all."""
    deviation: Deviation | None = None
    """From `exact`; null: not measured."""


@dataclass(frozen=True)
class RigEntry:
    """Named face units, such as ARKit's: what weights of 0 to 1 move."""

    names: tuple[str, ...]
    deltas: str
    """.npz with `names` (K,) and `deltas` float32 (K, V, 3)."""


@dataclass(frozen=True)
class Manifest:
    """manifest.json as a value; see docs/bundle-format.md."""

    format_version: int
    name: str
    family: str
    """The kind of system, such as `codetalker`; for people and tools."""
    reference: str
    fps: float
    sample_rate: int
    normalise_audio: bool
    min_samples: int
    n_vertices: int
    unit: str
    """The unit of length, in words."""
    metres_per_unit: float | None
    """null: not known."""
    up_axis: UpAxis | None
    """null: not known."""
    styles: tuple[str, ...]
    modes: Mapping[str, ModeEntry]
    """The modes that the bundle can be animated in, by name; the first is the default."""
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
    rig: RigEntry | None
    """Face units, where the bundle has them."""
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
    quantisation: Deviation | None = None
    """From float32, where `precision` is another."""
    live: LiveEntry | None = None
    """How a stream hears; null: as the runtime chooses."""

    def __post_init__(self) -> None:
        window = self.modes.get("window")
        if not self.modes or (window and None in (window.window, window.delay_frames)):
            raise SpecError("modes: expected one or more, 'window' with window and delay_frames")
        self._check_names()
        self._check_numbers()
        reaches = [part.reach.after for part in self.parts if part.reach is not None]
        if self.live is not None and self.live.delay_frames > min(reaches, default=0):
            raise SpecError(
                f"live.delay_frames: expected at most {min(reaches, default=0)}, which the motion "
                f"decoder reaches ahead, got {self.live.delay_frames}"
            )
        self._check_conditions()

    def _check_names(self) -> None:
        names = {*self.files, *self.used_files, *self.styles, *self.regions, *self.identities}
        names |= {part.name for part in self.parts} | set(self.rig.names if self.rig else ())
        if odd := [n for n in names if len(n) > LONGEST_NAME or not n.isprintable()]:
            raise SpecError(f"expected names that can be shown, got {odd[0][:LONGEST_NAME]!r}")
        if not self.styles or not self.parts:
            raise SpecError("expected one or more styles and parts")

    def _check_numbers(self) -> None:
        window = self.modes.get("window")
        counts = {
            "sample_rate": self.sample_rate,
            "min_samples": self.min_samples,
            "n_vertices": self.n_vertices,
            "window": 1 if window is None else window.window,
            **{f"n_samples of {part.name}": part.n_samples for part in self.parts},
        }
        for name, value in counts.items():
            if value is None or not 1 <= value <= LARGEST:
                raise SpecError(f"{name}: expected 1 to {LARGEST:,}, got {value}")
        if window is not None and not 0 <= (window.delay_frames or 0) <= LARGEST:
            raise SpecError(f"delay_frames: expected 0 to {LARGEST:,}, got {window.delay_frames}")
        metres = 1.0 if self.metres_per_unit is None else self.metres_per_unit
        for name, number, most in (("fps", self.fps, 1000), ("metres_per_unit", metres, 1e9)):
            if not 0 < number <= most:
                raise SpecError(f"{name}: expected a number above 0, got {number}")
        pair = self.lip_pair
        if pair is not None and (len(pair) != 2 or not all(0 <= v < self.n_vertices for v in pair)):
            raise SpecError(f"lip_pair: expected two vertices, got {list(pair)[:3]}")

    def _check_conditions(self) -> None:
        with_codes: set[str] = set()
        for part in self.parts:
            if unknown := set(part.conditions_on) - with_codes:
                raise SpecError(
                    f"part {part.name!r} conditions on {sorted(unknown)}; expected parts of kind "
                    "'codes' before it"
                )
            with_codes |= {part.name} if part.kind == "codes" else set()

    @property
    def graphs(self) -> tuple[GraphEntry, ...]:
        """All graphs of the bundle, in the order in which they run."""
        return (self.speech_encoder, *(g for part in self.parts for g in part.graphs))

    @property
    def used_files(self) -> set[str]:
        """Every file that the manifest refers to."""
        named = {self.template, self.faces, self.colours, *self.regions.values()}
        named |= {*self.identities.values(), *(graph.path for graph in self.graphs)}
        named |= {file for p in self.parts for file in (p.codebook, p.vertices, p.rig_projection)}
        named |= set() if self.rig is None else {self.rig.deltas}
        named |= set() if self.live is None else {self.live.primer}
        return {file for file in named if file is not None}

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
        except (ValueError, RecursionError) as error:
            raise SpecError(f"not JSON: {error}") from error
        version = data.get("format_version") if isinstance(data, dict) else None
        if not isinstance(version, int) or isinstance(version, bool) or version < 1:
            raise SpecError(f"format_version: expected a positive number, got {version!r}")
        if version > FORMAT_VERSION:
            raise NewerFormatError(
                f"bundle format {version}; this release reads up to {FORMAT_VERSION}"
            )
        return from_plain(cls, data, "manifest")
