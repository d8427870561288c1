"""The demo head's motion in few numbers, and trained networks back to all vertices.

The head moves by 52 face units, so its motion spans 52 dimensions: an orthonormal basis holds it
without loss, and the 3V-wide layers train in a few dozen columns instead of 17,658. Distances of
coefficients are weighted distances of vertices; lips count more than the back of the head.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from facecode.arrays import AnyArray, Audio, Float32, Indices
from facecode_exporter.corpus.files import (
    clip_names,
    load_clip_audio,
    load_corpus_head,
    load_weights,
)
from facecode_exporter.head.face_units import FACE_UNITS
from facecode_exporter.head.head import LIP_PAIR, Head
from facecode_exporter.measures.openings import open_frames
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_spec.schema import SystemSpec

LIP_WEIGHT, EYE_WEIGHT = 24.0, 5.0
"""How much more a vertex of the lips, or of eyelids and brows, counts than another one in squared
distances."""
EYE_UNITS = ("eyeBlink", "brow")
EYE_REACH_M = 1e-3
GAZE_UNITS = ("eyeLook",)
"""Not in the motion of a whole face: nothing that one hears says where the eyes go, and codes that
hold lips and gaze together are lost between two gazes."""
SMALLEST = 1e-6
"""Of the largest direction of motion; units that leave a part of the face still give none."""


class MotionBasis:
    """Offsets (T, 3V) to coefficients (T, 3K) and back; K "vertices" hold all of the motion."""

    def __init__(self, head: Head, unit_spread: Float32, vertices: Indices | None = None) -> None:
        """Build the basis.

        Args:
            head: the demo head.
            unit_spread: (52,) root mean square weight of each face unit in the data, which sets
                the unit of the coefficients: their mean square is about 1.
            vertices: those of one part of the face; all, without gaze, by default.
        """
        vertex_weight = np.ones(head.template.shape[0])
        vertex_weight[_moved_by(head, EYE_UNITS)] = EYE_WEIGHT
        vertex_weight[head.regions["lips"]] = LIP_WEIGHT
        own = slice(None) if vertices is None else vertices
        units = head.unit_offsets[:, own].reshape(len(head.unit_offsets), -1).astype(np.float64)
        self._root = np.sqrt(np.repeat(vertex_weight[own], 3))
        _, size, rows = np.linalg.svd(units * self._root, full_matrices=False)
        rows = rows[size > SMALLEST * size[0]]
        self.n_vertices = -(-len(rows) // 3)
        padding = 3 * self.n_vertices - len(rows)
        self._rows = np.pad(rows, ((0, padding), (0, 0)))
        along = units * self._root @ self._rows.T
        if vertices is None:
            along[_named(GAZE_UNITS)] = 0
        spread = along * unit_spread[:, None]
        self._scale = float(np.sqrt(np.square(spread).sum() / len(self._rows)))
        self._from_units = along / self._scale

    def coefficients(self, unit_weights: AnyArray) -> Float32:
        """Face-unit weights (T, 52) to coefficients (T, 3K)."""
        return np.asarray(unit_weights @ self._from_units, dtype=np.float32)

    @property
    def encode(self) -> Tensor:
        """(3K, 3V): coefficients = encode @ offsets."""
        return torch.from_numpy(self._rows * self._root / self._scale)

    @property
    def decode(self) -> Tensor:
        """(3V, 3K): offsets = decode @ coefficients."""
        return torch.from_numpy((self._rows / self._root).T * self._scale)

    def system(self, full: SystemSpec) -> SystemSpec:
        """`full` on coefficients in place of vertices."""
        return dataclasses.replace(full, n_vertices=self.n_vertices)

    @torch.no_grad()
    def lift(self, trained: CodeTalker, full: SystemSpec) -> CodeTalker:
        """The network on all vertices that computes what `trained` does on coefficients.

        Its weights are rounded to float16 values, the precision in which they are kept.
        """
        net = CodeTalker(full)
        net.load_state_dict(rounded(self.lifted(trained.state_dict())))
        return net.eval()

    def lifted(self, state: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """The float64 weights of a `PartNet` on vertices, from those on coefficients."""
        wide = {k: v.double() for k, v in state.items()}
        for name in ("vertice_map.weight", "autoencoder.encoder.vertice_mapping.0.weight"):
            wide[name] = wide[name] @ self.encode
        for name in ("weight", "bias"):
            key = f"autoencoder.decoder.vertice_map_reverse.{name}"
            wide[key] = self.decode @ wide[key]
        return wide


def rounded(state: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Weights as float32 numbers that float16 holds exactly."""
    return {k: v.half().float() for k, v in state.items()}


def _moved_by(head: Head, prefixes: tuple[str, ...]) -> NDArray[np.bool_]:
    """(V,) vertices that a face unit with one of these names moves visibly."""
    reach = np.linalg.norm(head.unit_offsets[_named(prefixes)], axis=-1)
    return np.asarray((reach > EYE_REACH_M).any(axis=0))


def _named(prefixes: tuple[str, ...]) -> NDArray[np.bool_]:
    """(52,) face units with one of these names."""
    return np.array([unit.startswith(prefixes) for unit in FACE_UNITS])


class CorpusClips:
    """One split of a demo corpus, motion as coefficients."""

    def __init__(
        self, corpus: Path, split: str, basis: MotionBasis, styles: tuple[str, ...]
    ) -> None:
        self.corpus, self.styles = corpus, styles
        self.names = clip_names(corpus, split)
        self._offsets = [basis.coefficients(load_weights(corpus, name)) for name in self.names]

    def offsets(self, index: int) -> Float32:
        """(T, 3K) coefficients."""
        return self._offsets[index]

    def audio(self, index: int) -> Audio:
        """(n_samples,) at 16 kHz."""
        return load_clip_audio(self.corpus, self.names[index])

    def style(self, index: int) -> int:
        """The style that the clip's name begins with."""
        return self.styles.index(self.names[index].rpartition("_")[0])

    def open_mouth(self, closed_below: float) -> Sequence[NDArray[np.bool_]]:
        """(T,) of each clip: whether the mouth is open, by the distance of LIP_PAIR."""
        head, (upper, lower) = load_corpus_head(self.corpus), LIP_PAIR
        rest = head.template[upper] - head.template[lower]
        gap_units = head.unit_offsets[:, upper] - head.unit_offsets[:, lower]
        openings = [
            np.linalg.norm(
                rest + load_weights(self.corpus, name).astype(np.float32) @ gap_units, axis=1
            )
            - np.linalg.norm(rest)
            for name in self.names
        ]
        styles = [self.style(i) for i in range(len(self.names))]
        return open_frames(openings, styles, closed_below)


def corpus_basis(corpus: Path, vertices: Indices | None = None) -> MotionBasis:
    """The basis of a corpus's head, or of one part of it, in the unit of its training motion."""
    weights = np.concatenate([load_weights(corpus, name) for name in clip_names(corpus, "train")])
    spread = np.sqrt(np.square(weights, dtype=np.float32).mean(axis=0))
    return MotionBasis(load_corpus_head(corpus), spread, vertices)
