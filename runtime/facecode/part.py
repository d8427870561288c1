"""One part of the face: its codebook and graphs, and what they do for whole clips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from facecode.arrays import Codes, Float32, Indices, Offsets
from facecode.bundle import Bundle, load_array
from facecode.codebook import Codebook
from facecode.motion import MotionDecoder
from facecode.session import Graph
from facecode_spec.graphs import past_keys
from facecode_spec.manifest import PartEntry

HEAD_CHUNK = 64
"""Frames per call of the vertex head: enough to read its weights rarely, 18 MB for BIWI."""


@dataclass(frozen=True)
class Part:
    """The graphs and the codebook of one part of the face; a value, without state."""

    name: str
    codebook: Codebook
    decoder_step: Graph
    motion: MotionDecoder
    vertex_head: Graph
    n_layers: int
    dim: int
    codes_per_frame: int
    memory: tuple[str, ...]
    """What the decoder step reads of the encoded speech."""
    past_heads: int | None
    """Heads of the decoder step's past; None: rows of all heads, as in older bundles."""
    n_samples: int = 1
    conditions_on: tuple[str, ...] = ()
    vertices: Indices | None = None
    """(n,) the part's vertices; None: all."""

    @classmethod
    def open(cls, bundle: Bundle, entry: PartEntry, threads: int) -> Part:
        """Load one part of a verified bundle.

        Raises:
            GraphError, ManifestError.
        """

        def axes(name: str) -> tuple[str, ...]:
            return next(t.axes for t in entry.decoder_step.outputs if t.name == name)

        n_layers, _, dim = axes("keys")
        _, codes_per_frame, code_dim = axes("features")
        rows = load_array(bundle.root, entry.codebook, (-1, int(code_dim)), np.float32)
        graphs = (entry.decoder_step, entry.motion_decoder, entry.vertex_head)
        step, motion, head = (Graph(bundle.path(g.path), g, threads) for g in graphs)
        wanted = {t.name: t.axes for t in entry.decoder_step.inputs}
        given = [t.name for t in bundle.manifest.speech_encoder.outputs]
        return cls(
            entry.name,
            Codebook(rows),
            step,
            MotionDecoder.of(motion, entry.motion_decoder),
            head,
            int(n_layers),
            int(dim),
            int(codes_per_frame),
            tuple(name for name in given if name in wanted),
            int(wanted[past_keys(0)][1]) if "n_slots" in wanted[past_keys(0)] else None,
            entry.n_samples,
            entry.conditions_on,
            bundle.part_vertices(entry),
        )

    def decode(self, codes: Codes, offsets: Offsets) -> None:
        """Codes (B, T, H) of whole clips to `offsets` (B, T, V, 3), at the part's vertices."""
        (hidden,) = self.motion.run(
            ("hidden",), self.codebook.look_up(codes), np.arange(codes.shape[1])
        )
        self.show(hidden, offsets)

    def show(self, hidden: Float32, offsets: Offsets) -> None:
        """Hidden frames (B, T, E) to `offsets` (B, T, V, 3), at the part's vertices."""
        for start in range(0, hidden.shape[1], HEAD_CHUNK):
            chunk = slice(start, start + HEAD_CHUNK)
            moved = self.vertex_head.run(("offsets",), hidden=hidden[:, chunk])[0]
            if self.vertices is None:
                offsets[:, chunk] = moved
            else:
                offsets[:, chunk, self.vertices] = moved
