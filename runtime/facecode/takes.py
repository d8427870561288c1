"""Several faces for one voice: clips of equal length with a sample axis."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from facecode import writers
from facecode.animation import Animation
from facecode.arrays import Codes, Faces, Float32, Indices, Offsets
from facecode.errors import NoVerticesError


@dataclass(frozen=True, eq=False)
class Takes:
    """K animations of one recording; `takes[k]` is the k-th."""

    clips: tuple[Animation, ...]

    def __len__(self) -> int:
        return len(self.clips)

    def __repr__(self) -> str:
        first = self.clips[0]
        return f"<Takes: {len(self)} faces, each {first.summary(first.n_frames)}>"

    def __iter__(self) -> Iterator[Animation]:
        return iter(self.clips)

    def __getitem__(self, index: int) -> Animation:
        return self.clips[index]

    @property
    def offsets(self) -> Offsets:
        """(K, T, V, 3) float32, a new array each time."""
        return np.stack([clip.offsets for clip in self.clips])

    @property
    def vertices(self) -> Offsets:
        """(K, T, V, 3) float32, template plus offsets, a new array each time."""
        return np.stack([clip.vertices for clip in self.clips])

    @property
    def codes(self) -> Codes:
        """(K, T, H) int64, a new array each time."""
        return np.stack([clip.codes for clip in self.clips])

    @property
    def weights(self) -> Float32:
        """(K, T, n_units) float32 weights of the rig's units; see `Clip.weights`.

        Raises:
            NoRigError
        """
        return np.stack([clip.weights for clip in self.clips])

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names (n_units,) of the columns of `weights`.

        Raises:
            NoRigError
        """
        return self.clips[0].weight_names

    @property
    def faces(self) -> Faces | None:
        """(F, 3) int32 triangles, where the bundle knows its topology."""
        return self.clips[0].faces

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.clips[0].fps

    def diversity(self, vertices: Indices | None = None) -> float:
        """Mean distance between two of the clips, flattened over frames and vertices (APD).

        The sum of squares runs over the clip, as in CDFace (Gu et al. 2024), so that longer
        clips are further apart; 0 for one clip.

        Args:
            vertices: indices (n,) to look at, such as the region `lips` (LPD) or `upper_face`
                (UPD); all by default.

        Raises:
            NoVerticesError: clips of weights alone.
        """
        distances = self.distances(vertices)
        k = len(self)
        return float(distances.sum() / (k * (k - 1))) if k > 1 else 0.0

    def distances(self, vertices: Indices | None = None) -> Float32:
        """(K, K) distances between the clips, flattened over frames and vertices.

        Raises:
            NoVerticesError: clips of weights alone.
        """
        if self.clips[0].known_weights is not None:
            raise NoVerticesError.to_give("distances")
        shown = slice(None) if vertices is None else vertices
        flat = [clip.offsets[:, shown].ravel() for clip in self.clips]
        table = np.array([[np.linalg.norm(a - b) for b in flat] for a in flat])
        return np.asarray(table, np.float32)

    def save(self, path: str | os.PathLike[str], *, progress: bool = False) -> None:
        """Write all to one file: .npz with a sample axis, .mp4 with the faces side by side.

        Raises:
            OutputSuffixError, OutputFolderError, OutputWriteError, NoFacesError, MissingExtraError.
        """
        writers.save(self.clips, Path(path), progress)
