"""One part of the face: its graphs and, of kind `codes`, its codebook as values, without state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray, Codes, Float32, Indices, Offsets
from facecode.bundle import Bundle
from facecode.errors import CodesError, NoCodesError
from facecode.loop.prior import Codebook, MotionDecoder, open_prior
from facecode.session import Compute, Graph
from facecode_spec.entries import GraphEntry, PartEntry
from facecode_spec.graphs import past_keys
from facecode_spec.schema import PartKind

HEAD_CHUNK = 64
"""Frames per call of the vertex head: enough to read its weights rarely, 18 MB for BIWI."""


@dataclass(frozen=True)
class Part:
    """One part of the face."""

    name: str
    codebook: Codebook | None
    """None: a part of kind `offsets`."""
    decoder_step: Graph
    motion: MotionDecoder | None
    """None: a part of kind `offsets`."""
    vertex_head: Graph
    n_styles: int
    n_layers: int
    n_heads: int
    """Of the decoder step's self-attention."""
    dim: int
    """D, the width of the decoder step."""
    codes_per_frame: int
    """H; 0 for a part of kind `offsets`."""
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
        """Load one part of a verified bundle.

        Raises:
            GraphError, ProviderError, ManifestError.
        """
        step, sizes = entry.decoder_step, _sizes(entry.decoder_step)
        codebook, motion = open_prior(bundle, entry, compute)
        wanted = {tensor.name for tensor in step.inputs}
        return cls(
            name=entry.name,
            codebook=codebook,
            decoder_step=Graph(bundle.path(step.path), step, compute),
            motion=motion,
            vertex_head=Graph(bundle.path(entry.vertex_head.path), entry.vertex_head, compute),
            n_styles=sizes["n_styles"],
            n_layers=sizes["n_layers"],
            n_heads=sizes["n_heads"],
            dim=sizes["dim"],
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
    def kind(self) -> PartKind:
        """Which loop animates the part."""
        return "offsets" if self.codebook is None else "codes"

    @property
    def graphs(self) -> tuple[Graph, ...]:
        """The part's graphs in the order in which they run."""
        motion = () if self.motion is None else (self.motion.graph,)
        return (self.decoder_step, *motion, self.vertex_head)

    @property
    def prior(self) -> tuple[Codebook, MotionDecoder]:
        """What takes codes to motion.

        Raises:
            NoCodesError: a part of kind `offsets`.
        """
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
        for start in range(0, hidden.shape[1], HEAD_CHUNK):
            chunk = slice(start, start + HEAD_CHUNK)
            made = self.vertex_head.run(("offsets",), hidden=hidden[:, chunk])[0]
            if self.vertices is None:
                offsets[:, chunk] = made
            else:
                offsets[:, chunk, self.vertices] = made

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


def check_codes(codes: AnyArray, part: Part, n_frames: int | None = None) -> Codes:
    """Codes (..., T, H) of a part as int64.

    Raises:
        CodesError: not whole numbers, another H, outside the codebook, or not `n_frames` long.
        NoCodesError: a part without a codebook.
    """
    codebook, _ = part.prior
    array = np.asarray(codes)
    n_codes, wide = len(codebook.rows), part.codes_per_frame
    if array.ndim < 2 or array.shape[-1] != wide or array.dtype.kind not in "iu":
        raise CodesError(
            f"got {array.dtype} codes {array.shape} for {part.name}; expected whole numbers "
            f"(T, {wide})"
        )
    if array.size and not (array.min() >= 0 and array.max() < n_codes):
        raise CodesError(
            f"got codes {array.min()} to {array.max()} for {part.name}; expected 0 to {n_codes - 1}"
        )
    if n_frames is not None and array.shape[-2] != n_frames:
        raise CodesError(
            f"got codes of {array.shape[-2]} frames to hold for {part.name}; this speech has "
            f"{n_frames}"
        )
    return array.astype(np.int64)


def _sizes(step: GraphEntry) -> Mapping[str, int]:
    """Sizes of a part as the signature of its decoder step states them."""
    n_layers, _, dim = step.output("keys").axes
    named = {
        "n_layers": n_layers,
        "dim": dim,
        "n_heads": step.input(past_keys(0)).axes[1],
        "n_styles": step.input("style").axes[1],
    }
    return {name: int(size) for name, size in named.items()}
