"""Where one sample a pixel is not enough: along outlines and where two surfaces meet.

Comes in: what is seen at the centres of pixels, and the mesh. Goes out: the pixels that may show
more than one stretch of skin. Steps between neighbouring centres tell most of them; what is thinner
than a pixel, such as a mouth that just opens, is found as edges between a triangle that faces the
viewer and one that does not, or none.
"""

from __future__ import annotations

import numpy as np

from facecode.arrays import Faces, Float32
from facecode.render.region import Mask
from facecode.render.rows import Int

STEP = 6e-4  # in nearness, beyond the slope of one surface; a share of the nearest
HIDDEN = 1e-2  # an edge that lies this share farther than what is seen there does not count
POINTS_PER_PIXEL = 2  # along an edge


def steps(near: Float32, shell: Int) -> Mask:
    """(height, width) pixels beside a step in depth, or to another piece of the mesh.

    Args:
        near: (height, width) nearness, 0 where nothing is seen.
        shell: (height, width) the piece that is seen.
    """
    mask = np.zeros(near.shape, bool)
    least = STEP * float(near.max(initial=0))
    for seen, piece, found in ((near, shell, mask), (near.T, shell.T, mask.T)):
        slope = seen[1:] - seen[:-1]
        found[1:-1] |= np.abs(slope[1:] - slope[:-1]) > least  # nearness is linear on a plane
        other = piece[1:] != piece[:-1]
        found[1:] |= other
        found[:-1] |= other
    return mask


class Outline:
    """The edges of a mesh."""

    def __init__(self, faces: Faces) -> None:
        sides = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]))
        triangle = np.tile(np.arange(len(faces)), 3)
        order = np.lexsort((sides[:, 1], sides[:, 0]))
        sides, triangle = sides[order], triangle[order]
        first = np.flatnonzero(np.append(True, (sides[1:] != sides[:-1]).any(axis=1)))
        pair = np.diff(np.append(first, len(sides))) == 2
        self._ends = np.ascontiguousarray(sides[first].T)  # (2, E) vertices
        self._one = triangle[first]
        self._other = np.full(len(first), -1)  # where there is none, or several
        self._other[pair] = triangle[first[pair] + 1]

    def pixels(self, screen: Float32, near: Float32, facing: Mask, two_sided: bool) -> Int:
        """The pixels that seen edges of the outline pass through; some come several times.

        Args:
            screen: (3, V) in pixels.
            near: (height, width) nearness of what is seen.
            facing: (F,) triangles that show their outer side.
            two_sided: whether the others are drawn too.
        """
        height, width = near.shape
        one, other = facing[self._one], np.append(facing, False)[self._other]
        chosen = np.flatnonzero((one != other) | (two_sided & (self._other < 0)))
        start, end = np.take(screen, np.take(self._ends, chosen, axis=1), axis=1).swapaxes(0, 1)
        along = end - start
        length = np.abs(along[:2]).max(axis=0)
        length[~(length < max(height, width))] = 0  # out of the picture, or not finite
        n_points = (length * POINTS_PER_PIXEL).astype(np.int64) + 1
        edge = np.repeat(np.arange(len(chosen)), n_points)
        ends = np.cumsum(n_points)
        part = (np.arange(len(edge)) - (ends - n_points)[edge] + np.float32(0.5)) / n_points[edge]
        x, y, depth = np.take(start, edge, axis=1) + np.take(along, edge, axis=1) * part
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        column, row, depth = x[inside].astype(np.int64), y[inside].astype(np.int64), depth[inside]
        row *= width
        row += column
        return np.asarray(row[depth >= np.take(near, row) * np.float32(1 - HIDDEN)])
