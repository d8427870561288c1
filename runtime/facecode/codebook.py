"""Nearest code and look-up, in numpy.

Distances are formed in float64 like those of the graphs, so that both agree, and a codebook row is
its own nearest row. A tie goes to the lower code.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from facecode.arrays import Codes, Features, Float32, Vectors


class Codebook:
    """A codebook (N, C) of one part of the face."""

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
