"""How a part's motion is fed back in `exact` mode: the whole prefix, decoded again at every step.

The convolution reaches two frames ahead, so that all but the last three frames' outputs are final
and kept; the norm over the prefix and the attention change everything behind it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.arrays import AnyArray, Float32, Vectors
from facecode.buffers import GrowingBuffer
from facecode.session import Graph
from facecode_spec.manifest import GraphEntry

NEWEST = 3
"""Frames whose convolution the newest frame still changes, itself included."""
CONTEXT = 2
"""Frames before those that their convolution reads."""


@dataclass(frozen=True)
class MotionDecoder:
    """The graph `motion_decoder` with its sizes; a state that is not given is empty."""

    graph: Graph
    n_layers: int
    n_heads: int
    head_dim: int

    @classmethod
    def of(cls, graph: Graph, entry: GraphEntry) -> MotionDecoder:
        """Sizes as the manifest states them."""
        n_layers, _, n_heads, _, head_dim = next(t.axes for t in entry.outputs if t.name == "keys")
        return cls(graph, int(n_layers), int(n_heads), int(head_dim))

    @property
    def dim(self) -> int:
        """E."""
        return self.n_heads * self.head_dim

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
        """Decode `features` (B, n, H, C) and show `frames` (m,); see the GraphSpec."""
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


class PrefixMotion:
    """The codes of a growing prefix, and the embedding of the motion of its last frame."""

    def __init__(self, decoder: MotionDecoder, n_rows: int, vector_shape: tuple[int, ...]) -> None:
        self._decoder = decoder
        self._vectors = GrowingBuffer(n_rows, vector_shape)
        self._known = GrowingBuffer(n_rows, (decoder.dim,))

    longest_past = None

    def append(self, vectors: Vectors) -> None:
        """Add the code vectors (rows, H, C) of one frame."""
        self._vectors.append(vectors)

    def feed_back(self, n: int) -> Float32:
        """(n, D) for the first `n` rows; to be called after every frame."""
        prefix = self._vectors.view(n_batch=n)
        start = max(0, prefix.shape[1] - NEWEST)
        feedback, activations = self._decoder.run(
            ("feedback", "activations"),
            prefix[:, start:],
            np.array([prefix.shape[1] - 1]),
            context=context_of(prefix, start),
            known=self._known.view(n_batch=n),
        )
        if activations.shape[1] == NEWEST:
            self._known.append(activations[:, 0])
        return feedback

    def finish(self) -> None:
        """See `MotionState`: the clip is decoded as a whole when its codes are known."""


def context_of(vectors: Vectors, start: int) -> Vectors:
    """The frames before `start` that the convolution reads; frame 0 stands before itself."""
    if start == 0:
        return vectors[:, :0]
    before = [max(0, start - 2), start - 1]
    return vectors[:, before]
