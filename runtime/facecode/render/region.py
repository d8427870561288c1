"""Some of an image's pixels, to draw on them alone.

Knows which triangles and rows touch them; knows nothing of depth.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Faces, Float32
from facecode.render.rows import Int, Int32, first_from

Mask: TypeAlias = NDArray[np.bool_]

SAMPLES = 2  # along each side of a pixel
BLOCK = 2  # pixels a side, of the blocks that triangles are looked up in


class Region:
    """The pixels of a mask (height, width), with SAMPLES x SAMPLES samples each."""

    def __init__(self, mask: Mask) -> None:
        self.size: tuple[int, int] = (mask.shape[0], mask.shape[1])
        self.pixels: Int = np.flatnonzero(mask)
        """(n,) of the image, in order"""
        self.across: Int = np.add.outer(self.pixels * SAMPLES, np.arange(SAMPLES)).ravel()
        """(n * SAMPLES,) samples of one row of each pixel, in an image that wide"""
        n_across = len(self.across)
        gaps = np.diff(self.across, prepend=-1, append=mask.size * SAMPLES)
        self._before: Int32 = np.repeat(np.arange(n_across + 1, dtype=np.int32), gaps)
        """(height * width * SAMPLES + 1,) how many of `across` lie before a sample"""
        row, column = (place // BLOCK for place in np.divmod(self.pixels, mask.shape[1]))
        height, width = self._blocks = tuple(1 + side // BLOCK for side in mask.shape)
        count = np.bincount(row * width + column, minlength=height * width)
        self._above = np.zeros((height + 1, width + 1), np.int64)
        """how many of `pixels` lie above a block and left of it"""
        self._above[1:, 1:] = count.reshape(height, width).cumsum(axis=0).cumsum(axis=1)

    def touched(self, screen: Float32, faces: Faces) -> Int:
        """Indices of the triangles whose box touches a block with one of the pixels."""
        height, width = self._blocks
        x, y = np.take(screen[:2] / BLOCK, faces.T, axis=1)
        left, right = first_from(x.min(axis=0) - 1, width), first_from(x.max(axis=0), width)
        top, bottom = first_from(y.min(axis=0) - 1, height), first_from(y.max(axis=0), height)
        top *= width + 1
        bottom *= width + 1
        count = np.take(self._above, bottom + right) + np.take(self._above, top + left)
        count -= np.take(self._above, bottom + left) + np.take(self._above, top + right)
        return np.flatnonzero(count)

    def within(self, first: Int32, length: Int32) -> tuple[Int32, Int32]:
        """Which of `across` lie in rows of samples: the first, and how many follow it."""
        before, until = np.take(self._before, first), np.take(self._before, first + length)
        return before, until - before
