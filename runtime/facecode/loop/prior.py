"""What takes codes to motion in a part of kind `codes`: codebook and motion decoder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from facecode.arrays import AnyArray, Codes, Features, Float32, Vectors
from facecode.bundle import Bundle
from facecode.bundle_files import load_array
from facecode.session import Compute, Graph
from facecode_spec.entries import GraphEntry, PartEntry, ReachEntry


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

    def with_graph(self, graph: Graph) -> MotionDecoder:
        """The same decoder with another graph of the same signature."""
        return replace(self, graph=graph)

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


def open_prior(
    bundle: Bundle, entry: PartEntry, compute: Compute
) -> tuple[Codebook, MotionDecoder] | tuple[None, None]:
    """Load what `entry` names; None for a part of kind `offsets`.

    Raises:
        GraphError, ProviderError, ManifestError.
    """
    if entry.codebook is None or entry.motion_decoder is None or entry.reach is None:
        return None, None
    width = int(entry.decoder_step.output("features").axes[2])
    rows = load_array(bundle.root, entry.codebook, (-1, width), np.float32)
    graph = Graph(bundle.path(entry.motion_decoder.path), entry.motion_decoder, compute)
    return Codebook(rows), MotionDecoder.of(graph, entry.motion_decoder, entry.reach)
