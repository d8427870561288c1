"""One part of the face: its graphs and, of kind `codes`, its codebook as values, without state."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray, Codes, Features, Float32, Indices, Offsets, Vectors
from facecode.bundle import Bundle
from facecode.bundle_files import load_array
from facecode.errors import ManifestError, NoCodesError
from facecode.session import Compute, Graph
from facecode_spec.entries import GraphEntry, PartEntry, ReachEntry
from facecode_spec.graphs import past_keys

HEAD_CHUNK = 64
"""Frames per call of the vertex head: enough to read its weights rarely, 18 MB for BIWI."""


class Codebook:
    """A codebook (N, C): nearest code and look-up, in numpy.

    Distances are formed in float64 like those of the graphs, so that both agree, and a codebook
    row is its own nearest row. A tie goes to the lower code.
    """

    def __init__(self, rows: Float32) -> None:
        self.rows = rows
        self._columns = np.ascontiguousarray(rows.T, dtype=np.float64)
        self._half_norms = np.square(self._columns).sum(axis=0) / 2

    def nearest(self, features: Features) -> Codes:
        """Features (..., C) to codes (...) int64 by squared L2 distance."""
        # |z - e|^2 / 2 less the part that all codes share.
        score = self._half_norms - features.astype(np.float64) @ self._columns
        return cast(Codes, score.argmin(axis=-1))

    def look_up(self, codes: Codes) -> Vectors:
        """Codes (...) to their rows (..., C)."""
        return self.rows[codes]


@dataclass(frozen=True)
class MotionDecoder:
    """The graph `motion_decoder` with its sizes; a state that is not given is empty."""

    graph: Graph
    reach: ReachEntry
    n_layers: int
    n_heads: int
    head_dim: int

    @classmethod
    def of(cls, graph: Graph, entry: GraphEntry, reach: ReachEntry) -> MotionDecoder:
        """Sizes as the manifest states them."""
        n_layers, _, n_heads, _, head_dim = entry.output("keys").axes
        return cls(graph, reach, int(n_layers), int(n_heads), int(head_dim))

    @property
    def dim(self) -> int:
        """E."""
        return self.n_heads * self.head_dim

    @property
    def n_newest(self) -> int:
        """Frames whose convolution the newest frame still changes, itself included."""
        return self.reach.after + 1

    def context(self, vectors: Vectors, start: int) -> Vectors:
        """The frames before `start` that the convolution reads; frame 0 stands before itself."""
        if start == 0:
            return vectors[:, :0]
        return vectors[:, [max(0, start - k) for k in range(self.reach.before, 0, -1)]]

    def run(
        self,
        outputs: Sequence[str],
        features: Vectors,
        frames: AnyArray,
        *,
        context: Vectors | None = None,
        known: Float32 | None = None,
        **past: AnyArray,
    ) -> list[AnyArray]:
        """Decode `features` (B, n, H, C) and give `frames` (m,); see the GraphSpec."""
        n = len(features)
        return self.graph.run(
            outputs,
            features=features,
            frames=frames,
            context=features[:, :0] if context is None else context,
            known=np.empty((n, 0, self.dim), np.float32) if known is None else known,
            **(past or self._no_past(n)),
        )

    def past_inputs(
        self, keys: Iterable[Float32], values: Iterable[Float32]
    ) -> dict[str, AnyArray]:
        """Rows (B, heads, p, width) of every layer by graph input name."""
        named: dict[str, AnyArray] = {f"past_keys_{i}": rows for i, rows in enumerate(keys)}
        return named | {f"past_values_{i}": rows for i, rows in enumerate(values)}

    def _no_past(self, n: int) -> dict[str, AnyArray]:
        zeros = np.zeros((n, self.dim), np.float32)
        none = [np.empty((n, self.n_heads, 0, self.head_dim), np.float32)] * self.n_layers
        return {
            "revisited": zeros[:, None][:, :0],
            "count": np.zeros((), np.float32),
            "mean": zeros,
            "squares": zeros,
            "past_log_weights": np.empty(0, np.float32),
            "revisited_log_weights": np.empty(0, np.float32),
            **self.past_inputs(none, none),
        }


@dataclass(frozen=True)
class Part:
    """One part of the face."""

    name: str
    codebook: Codebook | None
    """None, as `motion`: a part of kind `offsets`."""
    decoder_step: Graph
    motion: MotionDecoder | None
    vertex_head: Graph
    n_styles: int
    n_layers: int
    n_heads: int
    """Of the decoder step's self-attention."""
    dim: int
    """D, the width of the decoder step."""
    codes_per_frame: int
    memory: tuple[str, ...]
    """What the decoder step reads of the encoded speech."""
    n_samples: int = 1
    conditions_on: tuple[str, ...] = ()
    vertices: Indices | None = None
    """(n,) the part's vertices; None: all."""
    rig_projection: NDArray[np.float64] | None = None
    """(U, E + 1): hidden frames, and 1, to the products of offsets with the deltas of the rig."""

    @classmethod
    def open(cls, bundle: Bundle, entry: PartEntry, compute: Compute) -> Part:
        """Load one part of a verified bundle; GraphError, ManifestError, ProviderError."""
        step = entry.decoder_step
        n_layers, _, dim = step.output("keys").axes
        codebook, motion = _open_prior(bundle, entry, compute)
        wanted = {tensor.name for tensor in step.inputs}
        return cls(
            name=entry.name,
            codebook=codebook,
            decoder_step=Graph(bundle.path(step.path), step, compute),
            motion=motion,
            vertex_head=Graph(bundle.path(entry.vertex_head.path), entry.vertex_head, compute),
            n_styles=int(step.input("style").axes[1]),
            n_layers=int(n_layers),
            n_heads=int(step.input(past_keys(0)).axes[1]),
            dim=int(dim),
            codes_per_frame=entry.codes_per_frame,
            memory=tuple(
                t.name for t in bundle.manifest.speech_encoder.outputs if t.name in wanted
            ),
            n_samples=entry.n_samples,
            conditions_on=entry.conditions_on,
            vertices=bundle.part_vertices(entry),
            rig_projection=bundle.rig_projection(entry),
        )

    @property
    def graphs(self) -> tuple[Graph, ...]:
        """The part's graphs in the order in which they run."""
        motion = () if self.motion is None else (self.motion.graph,)
        return (self.decoder_step, *motion, self.vertex_head)

    @property
    def prior(self) -> tuple[Codebook, MotionDecoder]:
        """What takes codes to motion; NoCodesError for a part of kind `offsets`."""
        if self.codebook is None or self.motion is None:
            raise NoCodesError(
                f"part {self.name!r} has no codebook: this system gives motion itself, not codes; "
                "use the offsets or vertices of its clips"
            )
        return self.codebook, self.motion

    def hidden_of(self, codes: Codes) -> Float32:
        """Hidden frames (B, T, E) of the codes (B, T, H) of whole clips."""
        codebook, motion = self.prior
        vectors, every = codebook.look_up(codes), np.arange(codes.shape[1])
        return cast(Float32, motion.run(("hidden",), vectors, every)[0])

    def write_offsets(self, hidden: Float32, offsets: Offsets) -> None:
        """Hidden frames (B, T, E) to `offsets` (B, T, V, 3), at the part's vertices."""
        own = slice(None) if self.vertices is None else self.vertices
        for start in range(0, hidden.shape[1], HEAD_CHUNK):
            chunk = slice(start, start + HEAD_CHUNK)
            offsets[:, chunk, own] = self.vertex_head.run(("offsets",), hidden=hidden[:, chunk])[0]

    def copy_offsets(self, source: Offsets, target: Offsets) -> None:
        """The part's vertices of `source` (K, T, V, 3) into `target`, face by face."""
        own = slice(None) if self.vertices is None else self.vertices
        target[:, :, own] = source[:, :, own]

    def products(self, hidden: Float32) -> NDArray[np.float64]:
        """Hidden frames (B, T, E) to (B, T, U): offsets of the part times the deltas of each unit.

        A frame gives the same bits alone and among others.
        """
        assert self.rig_projection is not None, "checked by the request"
        by_column, constant = self.rig_projection[:, :-1], self.rig_projection[:, -1]
        return np.asarray(np.einsum("bte,ue->btu", hidden.astype(np.float64), by_column) + constant)


def offsets_of(
    parts: Sequence[Part], hidden: Sequence[Float32], n_faces: int, n_vertices: int
) -> Offsets:
    """Offsets (n_faces, T, V, 3) of all parts' hidden frames (rows, T, E)."""
    n_frames = hidden[0].shape[1]
    offsets = np.empty((n_faces, n_frames, n_vertices, 3), dtype=np.float32)
    for part, rows in zip(parts, hidden, strict=True):
        share = n_faces // len(rows)
        part.write_offsets(rows, offsets[::share])
        for k in range(1, share):
            part.copy_offsets(offsets[::share], offsets[k::share])
    return offsets


def products_of(parts: Sequence[Part], hidden: Sequence[Float32], n_faces: int) -> AnyArray:
    """Products (n_faces, T, U) float64: the sum of what parts give for their own vertices."""
    each = [part.products(rows) for part, rows in zip(parts, hidden, strict=True)]
    return np.asarray(sum(np.repeat(rows, n_faces // len(rows), axis=0) for rows in each))


def _open_prior(
    bundle: Bundle, entry: PartEntry, compute: Compute
) -> tuple[Codebook, MotionDecoder] | tuple[None, None]:
    if entry.codebook is None or entry.motion_decoder is None or entry.reach is None:
        return None, None
    width = int(entry.decoder_step.output("features").axes[2])
    rows = load_array(bundle.root, entry.codebook, (-1, width), np.float32)
    if not len(rows):
        raise ManifestError(f"{entry.codebook} has no code; export the bundle again")
    graph = Graph(bundle.path(entry.motion_decoder.path), entry.motion_decoder, compute)
    return Codebook(rows), MotionDecoder.of(graph, entry.motion_decoder, entry.reach)
