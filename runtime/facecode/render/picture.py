"""Frames of a clip as pictures, without a display or a GPU.

Comes in: a template with faces, its motion, colours. Goes out: (size, size, 3) uint8 sRGB.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import reduce

import numpy as np

from facecode.arrays import Colours, Faces, Float32, Offsets, Template
from facecode.render import light, raster
from facecode.render.camera import Camera, spread
from facecode.render.occlusion import openness
from facecode.render.outline import Outline, steps
from facecode.render.paint import Picture, edge_light, paint_once
from facecode.render.region import Mask, Region
from facecode.render.rows import Int, cross
from facecode.render.surface import Planes, outward, shells, vertex_normals

WORKERS = 2  # threads: numpy holds the interpreter for part of the work
LOOKED_AT, POSES = 64, 2  # frames of the clip that are compared, and chosen to see how open it is
UNNOTICED = 1e-4  # share of the face's pixels
DIMMEST = 0.25  # openness of the deepest crevice


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
        self.faces = outward(template, faces)
        self._shell, self._outline = shells(self.faces, len(template)), Outline(self.faces)
        self._camera = Camera.framing(template, offsets)
        if colours is None:
            colours = np.broadcast_to(np.array(light.CLAY, np.uint8), template.shape)
        self._vertex_colours = light.linear(colours).T
        poses = self._poses()
        self._openness = self._seen_openness(poses)
        self._two_sided = any(self._shows_inside(pose) for pose in poses)
        self._light_behind = light.background(size)
        self._background = light.to_srgb(self._light_behind)

    def frame(self, index: int) -> Picture:
        """Frame `index` as (size, size, 3) uint8, planar in memory."""
        vertices = self.template + self.offsets[index]
        screen = self._camera.project(vertices, self.size)
        box = _box(screen, self.size)
        if box is None:
            return np.asarray(self._background.copy().transpose(1, 2, 0))
        rows, columns = box
        screen[:2] -= [[columns.start], [rows.start]]
        picture = self._background.copy()  # planar: pixels are written three times as fast
        behind = self._light_behind[:, rows, columns]
        picture[:, rows, columns] = self._drawn(vertices, screen, picture[:, rows, columns], behind)
        return np.asarray(picture.transpose(1, 2, 0))

    def _drawn(
        self, vertices: Template, screen: Float32, picture: Picture, behind: Float32
    ) -> Picture:
        """The face, at `screen`, over picture (3, height, width): in linear light, `behind`."""
        shape = height, width = picture.shape[1:]
        facing = _facing(screen, self.faces)
        drawn = np.arange(len(self.faces)) if self._two_sided else np.flatnonzero(facing)
        if not len(drawn):
            return picture
        faces = self.faces[drawn]
        keys = raster.draw(screen, faces, (height, width))
        mixed = self._mixed(screen, keys.reshape(shape), self._shell[drawn], facing)
        planes = Planes(screen, faces, self._attributes(vertices))
        painted = picture.reshape(3, -1)
        once = np.flatnonzero((keys > 0) & ~mixed.ravel())
        paint_once(painted, once, keys, planes, width)
        region = Region(mixed)
        nothing = np.take(behind.reshape(3, -1), region.pixels, axis=1)
        seen = edge_light(region, screen, faces, planes, nothing)
        painted[:, region.pixels] = light.to_srgb(seen)
        return painted.reshape(picture.shape)

    def _mixed(self, screen: Float32, keys: raster.Keys, shell: Int, facing: Mask) -> Mask:
        """(height, width) pixels that may show more than one stretch of skin."""
        near = raster.nearness_of(keys)
        mask = steps(near, np.take(shell, raster.triangle_of(keys)))
        mask.ravel()[self._outline.pixels(screen, near, facing, self._two_sided)] = True
        return mask

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
        motion = np.abs(self.offsets[frames] - self.offsets[0]).mean(axis=(1, 2))
        order = frames[np.argsort(motion, kind="stable")]
        chosen = order[spread(len(order), POSES)]
        return [np.nan_to_num(self.template + self.offsets[i]) for i in chosen]

    def _seen_openness(self, poses: list[Template]) -> Float32:
        """The most open of the poses: teeth that a later frame shows are not left in the dark."""
        each = (openness(pose, vertex_normals(pose, self.faces), self.faces) for pose in poses)
        return np.asarray(DIMMEST + (1 - DIMMEST) * reduce(np.maximum, each), np.float32)

    def _shows_inside(self, pose: Template) -> bool:
        """Whether the camera sees back sides, as through the open mouth of a face without a throat.

        Where it does not, they are not drawn, which saves a third of the time.
        """
        screen = self._camera.project(pose, self.size)
        keys = raster.draw(screen, self.faces, (self.size, self.size))
        seen = np.bincount(raster.triangle_of(keys[keys > 0]), minlength=len(self.faces))
        return bool(seen[~_facing(screen, self.faces)].sum() > UNNOTICED * seen.sum())


def _facing(screen: Float32, faces: Faces) -> Mask:
    """(F,) which triangles show their outer side."""
    x, y = np.take(screen[:2], faces.T, axis=1)
    return cross(x, y) < 0


def _box(screen: Float32, size: int) -> tuple[slice, slice] | None:
    """The rows and columns of pixels that the face touches; None where it touches none."""
    finite = screen[:2, np.isfinite(screen).all(axis=0)]
    if not finite.size:
        return None
    x, y = finite
    left, top = max(int(x.min()) - 1, 0), max(int(y.min()) - 1, 0)
    right, bottom = min(int(x.max()) + 2, size), min(int(y.max()) + 2, size)
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None
