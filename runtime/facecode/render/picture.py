"""Frames of a clip as pictures, without a display or a GPU.

Comes in: a template with faces, its motion, colours. Goes out: (size, size, 3) uint8 sRGB. Every
pixel has SAMPLES x SAMPLES samples for its edges; where all of them lie on one smooth stretch of
skin it is shaded once, as multisampling does.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Colours, Faces, Float32, Offsets, Template
from facecode.render import light, raster
from facecode.render.camera import Camera, spread
from facecode.render.occlusion import openness

SAMPLES = 2
WORKERS = 2  # threads: numpy holds the interpreter for part of the work: 0 to 40 % over one
LOOKED_AT, POSES = 64, 2  # frames of the clip that are compared, and chosen to see how open it is
SMOOTH = 6e-4  # step in nearness within a pixel, as a share, that is still one surface
CHUNK = 1 << 14  # pixels shaded at a time: what they need stays in the cache
UNNOTICED = 1e-4  # share of the face's pixels
DIMMEST = 0.25  # openness of the deepest crevice
INSIDE = 0.12  # share of the light for a surface seen from behind

Picture = NDArray[np.uint8]
_OFFSETS = [(i + 0.5) / SAMPLES for i in range(SAMPLES)]


class Renderer:
    """Draws the frames of one clip; keeps the view, the light and the colours."""

    def __init__(
        self,
        template: Template,
        offsets: Offsets,
        faces: Faces,
        colours: Colours | None,
        size: int,
    ) -> None:
        """Frame the clip of offsets (T, V, 3) for square pictures of `size` pixels."""
        self.size, self.template, self.offsets = size, template, offsets
        self.faces = _outward(template, faces)
        self._shell = _shells(self.faces, len(template))
        self._camera = Camera.framing(template, offsets)
        if colours is None:
            colours = np.broadcast_to(np.array(light.CLAY, np.uint8), template.shape)
        self._vertex_colours = light.linear(colours).T
        poses = self._poses()
        self._openness = self._seen_openness(poses)
        self._two_sided = any(self._shows_inside(pose) for pose in poses)
        self._background = light.to_srgb(light.background(size)).reshape(size, size, 3)

    def frame(self, index: int) -> Picture:
        """Frame `index` as (size, size, 3) uint8."""
        vertices = self.template + self.offsets[index]
        screen = self._camera.project(vertices, self.size * SAMPLES)
        picture: Picture = self._background.copy()
        box = _box(screen, self.size)
        if box is None:
            return picture
        rows, columns = box
        screen[:2] -= [[columns.start * SAMPLES], [rows.start * SAMPLES]]
        height, width = rows.stop - rows.start, columns.stop - columns.start
        drawn = slice(None) if self._two_sided else _in_front(screen, self.faces)
        faces = self.faces[drawn]
        keys = raster.draw(screen, faces, (height * SAMPLES, width * SAMPLES))
        keys = keys.reshape(height, SAMPLES, width, SAMPLES)
        planes = _Planes(screen, faces, self._attributes(vertices), self._shell[drawn])
        behind = picture[rows, columns].reshape(-1, 3)
        _paint(behind, _planar(keys), planes, width)
        picture[rows, columns] = behind.reshape(height, width, 3)
        return picture

    def frames(self, workers: int = WORKERS) -> Iterator[Picture]:
        """All frames in order; a few are drawn ahead in threads while the caller has the last."""
        n_frames, ahead = len(self.offsets), 2 * workers
        with ThreadPoolExecutor(workers, "facecode-render") as pool:
            drawn = deque(pool.submit(self.frame, i) for i in range(min(ahead, n_frames)))
            try:
                for index in range(ahead, n_frames + ahead):
                    yield drawn.popleft().result()
                    if index < n_frames:
                        drawn.append(pool.submit(self.frame, index))
                    if not drawn:
                        return
            finally:
                pool.shutdown(wait=True, cancel_futures=True)

    def _attributes(self, vertices: Template) -> Float32:
        """What is interpolated (7, V): normal in the camera's axes, colour, openness."""
        normals = vertex_normals(vertices, self.faces) @ self._camera.rotation.T
        return np.concatenate([normals.T, self._vertex_colours, self._openness[None]])

    def _poses(self) -> list[Template]:
        """Two that differ: the nearest to the first frame, which itself is, and the farthest."""
        frames = spread(len(self.offsets), LOOKED_AT)
        moved = np.abs(self.offsets[frames] - self.offsets[0]).mean(axis=(1, 2))
        order = frames[np.argsort(moved, kind="stable")]
        chosen = order[spread(len(order), POSES)]
        return [np.nan_to_num(self.template + self.offsets[i]) for i in chosen]

    def _seen_openness(self, poses: list[Template]) -> Float32:
        """The most open of the poses: teeth that a later frame shows are not left in the dark."""
        each = (openness(pose, vertex_normals(pose, self.faces), self.faces) for pose in poses)
        return np.asarray(DIMMEST + (1 - DIMMEST) * reduce(np.maximum, each), np.float32)

    def _shows_inside(self, pose: Template) -> bool:
        """Whether the camera sees back sides, as through the open mouth of a face without a throat.

        Where it does not, they are not drawn, which saves 22 of 64 ms a head.
        """
        screen = self._camera.project(pose, self.size)
        keys = raster.draw(screen, self.faces, (self.size, self.size))
        seen = np.unique(raster.triangle_of(keys[keys > 0]), return_counts=True)
        behind = ~np.isin(seen[0], _in_front(screen, self.faces))
        return bool(seen[1][behind].sum() > UNNOTICED * seen[1].sum())


def _planar(keys: raster.Keys) -> list[raster.Keys]:
    """Keys (height, SAMPLES, width, SAMPLES) as SAMPLES^2 arrays (height * width,)."""
    each = range(SAMPLES)
    return [keys[:, down, :, right].ravel() for down in each for right in each]


def _paint(picture: Picture, keys: list[raster.Keys], planes: _Planes, width: int) -> None:
    """Paint samples, SAMPLES^2 times (n,), over picture (n, 3), rows of `width` pixels."""
    nearest, farthest = reduce(np.maximum, keys), reduce(np.minimum, keys)
    touched = np.flatnonzero(nearest)
    near, far = (raster.nearness_of(side[touched]) for side in (nearest, farthest))
    smooth = far > near * np.float32(1 - SMOOTH)
    shells = [planes.shell[raster.triangle_of(samples[touched])] for samples in keys]
    for shell in shells[1:]:
        smooth &= shell == shells[0]
    once, mixed = touched[smooth], touched[~smooth]
    for start in range(0, len(once), CHUNK):
        pixel = once[start : start + CHUNK]
        seen = planes.shade(raster.triangle_of(keys[0][pixel]), *_position(pixel, width, 0.5, 0.5))
        picture[pixel] = light.to_srgb(seen).T
    behind = light.linear(picture[mixed])
    total = np.zeros_like(behind)
    for sample, samples in enumerate(keys):
        there = samples[mixed] > 0
        down, right = np.divmod(sample, SAMPLES)
        pixel = mixed[there]
        position = _position(pixel, width, _OFFSETS[right], _OFFSETS[down])
        total[there] += planes.shade(raster.triangle_of(samples[pixel]), *position).T
        total[~there] += behind[~there]
    picture[mixed] = light.to_srgb(total / np.float32(SAMPLES**2))


def _box(screen: Float32, size: int) -> tuple[slice, slice] | None:
    """The rows and columns of pixels that the face touches; None where it touches none."""
    finite = screen[:2, np.isfinite(screen).all(axis=0)]
    if not finite.size:
        return None
    x, y = finite / SAMPLES
    left, top = max(int(x.min()) - 1, 0), max(int(y.min()) - 1, 0)
    right, bottom = min(int(x.max()) + 2, size), min(int(y.max()) + 2, size)
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


class _Planes:
    """Attributes over the screen: of each triangle the value at a corner and two gradients."""

    def __init__(
        self, screen: Float32, faces: Faces, attributes: Float32, shell: NDArray[np.int64]
    ) -> None:
        self.shell = shell
        (x, y), values = screen[:2, faces] / SAMPLES, attributes[:, faces]
        area = raster.cross(x, y)
        with np.errstate(divide="ignore", invalid="ignore"):  # triangles that nobody sees
            by_x, by_y = raster.gradients(x, y, values, area)
        self._x, self._y, self._from_behind = x[:, 0], y[:, 0], area > 0
        self._table = np.stack([values[..., 0], by_x, by_y])

    def shade(self, triangle: NDArray[np.int64], x: Float32, y: Float32) -> Float32:
        """Linear RGB (3, n) of samples at pixels x, y on their triangles."""
        x -= self._x[triangle]
        y -= self._y[triangle]
        at_corner, by_x, by_y = np.take(self._table, triangle, axis=2)
        by_x *= x
        by_y *= y
        at_corner += by_x
        at_corner += by_y
        # A pixel's centre may lie just outside its triangle: nothing may run out of range there.
        np.clip(at_corner[3:], 0, 1, out=at_corner[3:])
        seen = light.shade(at_corner[:3], at_corner[3:6], at_corner[6])
        seen *= np.where(self._from_behind[triangle], np.float32(INSIDE), np.float32(1))
        return seen


def vertex_normals(vertices: Template, faces: Faces) -> Template:
    """(V, 3) unit normals, each the mean of its triangles' by area."""
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across[~np.isfinite(across).all(axis=1)] = 0
    total = np.stack(
        [
            np.bincount(faces.ravel(), np.repeat(across[:, axis], 3), len(vertices))
            for axis in range(3)
        ],
        axis=1,
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(length > 0, length, 1), np.float32)


def _shells(faces: Faces, n_vertices: int) -> NDArray[np.int64]:
    """(F,) a number for each connected piece: brows and eyeballs lie close to the skin."""
    piece = np.arange(n_vertices)
    while True:
        least = piece.copy()
        np.minimum.at(least, faces, piece[faces].min(axis=1, keepdims=True))
        least = least[least]
        if np.array_equal(least, piece):
            return piece[faces[:, 0]]
        piece = least


def _outward(template: Template, faces: Faces) -> Faces:
    """Faces with their corners counter-clockwise seen from outside, as their volume tells."""
    one, two, three = (template - template.mean(axis=0))[faces].transpose(1, 0, 2)
    volume = np.einsum("fi,fi->", one, np.cross(two, three))
    return faces if volume >= 0 else np.ascontiguousarray(faces[:, ::-1])


def _in_front(screen: Float32, faces: Faces) -> NDArray[np.int64]:
    """Indices of the triangles that show their outer side."""
    x, y = screen[:2, faces]
    return np.flatnonzero(raster.cross(x, y) < 0)


def _position(
    pixel: NDArray[np.int64], size: int, right: float, down: float
) -> tuple[Float32, Float32]:
    y, x = np.divmod(pixel, size)
    return np.asarray(x + right, np.float32), np.asarray(y + down, np.float32)
