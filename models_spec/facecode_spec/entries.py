"""What a manifest says of files, graphs and the parts of the face."""

from __future__ import annotations

from dataclasses import dataclass

from facecode_spec.graphs import GraphSpec, TensorSpec
from facecode_spec.plain import SpecError
from facecode_spec.schema import PartKind


@dataclass(frozen=True)
class FileEntry:
    """Size in bytes and SHA-256 (hexadecimal) of one file of the bundle."""

    size: int
    sha256: str


@dataclass(frozen=True)
class GraphEntry:
    """One graph file with its signature."""

    path: str
    inputs: tuple[TensorSpec, ...]
    outputs: tuple[TensorSpec, ...]

    @classmethod
    def of(cls, path: str, spec: GraphSpec) -> GraphEntry:
        """The entry of a graph with signature `spec` at `path`."""
        return cls(path, spec.inputs, spec.outputs)

    def output(self, name: str) -> TensorSpec:
        """The output of that name.

        Raises:
            KeyError
        """
        return {tensor.name: tensor for tensor in self.outputs}[name]

    def input(self, name: str) -> TensorSpec:
        """The input of that name.

        Raises:
            KeyError
        """
        return {tensor.name: tensor for tensor in self.inputs}[name]


@dataclass(frozen=True)
class ReachEntry:
    """Frames on either side of a frame that its convolution in the motion decoder reads."""

    before: int
    after: int


@dataclass(frozen=True)
class PartEntry:
    """The files of one part of the face, in the order in which parts are animated."""

    name: str
    kind: PartKind
    """Which loop animates the part: `codes`, or `offsets` for one without a codebook."""
    decoder_step: GraphEntry
    vertex_head: GraphEntry
    codebook: str | None = None
    """float32 (N, C) array; null: a part of kind `offsets`."""
    motion_decoder: GraphEntry | None = None
    """null: a part of kind `offsets`."""
    reach: ReachEntry | None = None
    """Of the motion decoder's convolution; null: a part of kind `offsets`."""
    n_samples: int = 1
    """Samples for each sample of the parts before it; the input `sample` picks one."""
    conditions_on: tuple[str, ...] = ()
    """Earlier parts whose code vectors of the frame are inputs `condition_<part>`."""
    vertices: str | None = None
    """int32 (n,) indices of the part's vertices, in the order of its offsets; null: all."""
    rig_projection: str | None = None
    """float64 (K, E + 1) array: the products of a frame's offsets with the deltas of the rig are
    its first E columns times the hidden frame, plus the last column. null: not known."""

    def __post_init__(self) -> None:
        needed = (self.codebook, self.motion_decoder, self.reach)
        if self.kind == "codes" and None in needed:
            raise SpecError(
                f"part {self.name!r} of kind 'codes' needs codebook, motion_decoder and reach"
            )
        if self.kind == "offsets" and needed != (None, None, None):
            raise SpecError(
                f"part {self.name!r} of kind 'offsets' has a codebook, a motion_decoder or a reach"
            )

    @property
    def codes_per_frame(self) -> int:
        """H; 0 for a part of kind `offsets`."""
        return int(self.decoder_step.output("features").axes[1]) if self.codebook else 0

    @property
    def graphs(self) -> tuple[GraphEntry, ...]:
        """The part's graphs in the order in which they run."""
        every = (self.decoder_step, self.motion_decoder, self.vertex_head)
        return tuple(graph for graph in every if graph is not None)
