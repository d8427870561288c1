"""The parts of the demo head as linear maps from the base mesh.

A part's vertices are weighted sums of base vertices plus a fixed offset, so that whatever moves the
base (a face unit, an identity) moves the part. Comes in: the base mesh. Goes out: parts in the
base's unit. Knows nothing of colours and files.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from facecode_exporter.head.anny_wheel import Float, Int

# Two neighbours on a closed loop of 42 edges around the neck, and the tip of the nose.
NECK_LOOP = (1522, 1521)
NOSE_TIP = 297


@dataclass(frozen=True)
class Part:
    """`vertices = sum(weights * base[sources]) + lift`."""

    name: str
    sources: Int
    """(n, k) base vertices"""
    weights: Float
    """(n, k)"""
    triangles: Int
    lift: Float
    """(n, 3)"""

    def displacement(self, base: Float) -> Float:
        """(n, 3) the part of a displacement (or the positions before the lift) of the base."""
        return np.asarray(np.einsum("nk,nkd->nd", self.weights, base[self.sources]))

    def position(self, base: Float) -> Float:
        """(n, 3) the part of a base in some shape."""
        return self.displacement(base) + self.lift


def copied(name: str, quads: Int) -> Part:
    """The vertices of some quads as they are."""
    used, local = np.unique(quads, return_inverse=True)
    return Part(
        name,
        used[:, None],
        np.ones((len(used), 1)),
        triangulated(local.reshape(quads.shape)),
        np.zeros((len(used), 3)),
    )


def triangulated(quads: Int) -> Int:
    """(2n, 3) from (n, 4), the winding kept."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def head_quads(body: Int) -> Int:
    """The quads of the body above a closed loop of edges around the neck: the cut is clean."""
    fence = set(edge_loop(body, *NECK_LOOP))
    neighbours = _neighbours(body)
    inside, queue = set(fence), [NOSE_TIP]
    while queue:
        vertex = queue.pop()
        if vertex not in inside:
            inside.add(vertex)
            queue.extend(neighbours[vertex])
    return body[np.isin(body, list(inside)).all(axis=1)]


def edge_loop(quads: Int, first: int, second: int) -> list[int]:
    """The closed loop that goes straight on at every vertex of four edges.

    Raises:
        ValueError: the loop does not close.
    """
    neighbours = _neighbours(quads)
    quads_at: dict[frozenset[int], set[int]] = defaultdict(set)
    for index, quad in enumerate(quads.tolist()):
        for edge in zip(quad, quad[1:] + quad[:1], strict=True):
            quads_at[frozenset(edge)].add(index)
    loop = [first, second]
    while len(loop) <= len(quads):
        came, here = loop[-2:]
        touching = quads_at[frozenset((came, here))]
        ahead = [n for n in neighbours[here] if not touching & quads_at[frozenset((here, n))]]
        if len(ahead) != 1:
            break
        if ahead[0] == first:
            return loop
        loop.append(ahead[0])
    raise ValueError(f"no closed edge loop through the vertices {first} and {second}")


def _neighbours(quads: Int) -> dict[int, set[int]]:
    found: dict[int, set[int]] = defaultdict(set)
    for quad in quads.tolist():
        for a, b in zip(quad, quad[1:] + quad[:1], strict=True):
            found[a].add(b)
            found[b].add(a)
    return found


def affine_weights(anchors: Float, points: Float) -> Float:
    """(n, k) weights that write `points` (n, 3) as sums of `anchors` (k, 3).

    Of all such weights the smallest. Moving the anchors by any affine map moves the points alike,
    so a part of our own follows the jaw or the gaze of the helper it replaces.
    """
    system = np.vstack([anchors.T, np.ones(len(anchors))])
    return np.asarray(
        np.linalg.lstsq(system, np.vstack([points.T, np.ones(len(points))]), rcond=None)[0].T
    )


def attached(name: str, base: Float, anchors: Int, points: Float, triangles: Int) -> Part:
    """A part with its own shape that goes where the base vertices `anchors` go."""
    sources = np.broadcast_to(anchors, (len(points), len(anchors)))
    weights = affine_weights(base[anchors], points)
    return Part(name, sources, weights, triangles, np.zeros((len(points), 3)))


def sphere_of(points: Float) -> tuple[Float, float]:
    """Centre and radius of the sphere closest to some points."""
    system = np.hstack([2 * points, np.ones((len(points), 1))])
    solution = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    centre = solution[:3]
    return centre, float(np.sqrt(solution[3] + centre @ centre))


def grid_triangles(n_rows: int, n_columns: int, closed: bool = False) -> Int:
    """Triangles of a grid numbered row by row; `closed` joins the last column to the first."""
    row, column = np.mgrid[: n_rows - 1, : n_columns - (not closed)]
    following = (column + 1) % n_columns
    corners = [(row, column), (row, following), (row + 1, following), (row + 1, column)]
    return triangulated(np.stack([(r * n_columns + c).ravel() for r, c in corners], axis=1))
