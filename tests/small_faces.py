"""Small heads in motion for tests of writers: a ball whose units are known, with or without rig."""

import dataclasses

import numpy as np

from facecode.clip import Clip, Rig

NAMES = ("browDownLeft", "jawOpen", "mouthSmileRight", "tongueOut")
"""Of the units; the last one moves nothing."""


class RiggedClip(Clip):
    """A clip whose weights are known, so that nothing needs to be solved."""

    weights = None
    weight_names = NAMES


def ball(n_around=12, n_up=9):
    """Vertices (V, 3) of a unit ball, y up, and its triangles, seen from outside."""
    around = np.arange(n_around) * 2 * np.pi / n_around
    up = np.linspace(-1, 1, n_up + 2)[1:-1, None] * np.pi / 2
    rings = np.stack(
        [np.cos(up) * np.sin(around), np.sin(up) + 0 * around, np.cos(up) * np.cos(around)], -1
    )
    vertices = np.concatenate([rings.reshape(-1, 3), [[0, -1, 0], [0, 1, 0]]])
    at = np.arange(n_around * n_up).reshape(n_up, n_around)
    a, b = at[:-1], np.roll(at, -1, axis=1)[:-1]
    c, d = np.roll(at, -1, axis=1)[1:], at[1:]
    south, north = len(vertices) - 2, len(vertices) - 1
    caps = [(north, x, y) for x, y in zip(at[-1], np.roll(at[-1], -1), strict=True)]
    caps += [(south, y, x) for x, y in zip(at[0], np.roll(at[0], -1), strict=True)]
    sides = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    return vertices.astype(np.float32), np.concatenate([sides, caps]).astype(np.int32)


def units(template, seed=0):
    """(4, V, 3) displacements, each of a part of the ball; the last is nothing."""
    rng = np.random.default_rng(seed)
    centres = rng.standard_normal((len(NAMES), 3))
    near = np.einsum("vi,ki->kv", template, centres / np.linalg.norm(centres, axis=1)[:, None])
    strength = np.maximum(near - 0.5, 0)[..., None] * rng.standard_normal((len(NAMES), 1, 3))
    strength[-1] = 0
    return strength.astype(np.float32)


def rigged(n_frames=7, fps=30.0, seed=0, scale=0.1, **changes):
    """A clip of a ball of `scale` metres whose offsets are its weights times its units."""
    template, faces = ball()
    template, deltas = template * np.float32(scale), units(template, seed) * np.float32(scale)
    weights = np.random.default_rng(seed + 1).random((n_frames, len(NAMES)), np.float32)
    clip = RiggedClip(
        offsets=np.tensordot(weights, deltas, 1),
        codes=np.zeros((n_frames, 1), np.int64),
        fps=fps,
        template=template,
        faces=faces,
        colours=np.tile(np.uint8([200, 60, 0]), (len(template), 1)),
        metres_per_unit=1.0,
        unit="metres",
        up_axis="y",
        rig=Rig(NAMES, deltas),
    )
    object.__setattr__(clip, "weights", weights)
    return changed(clip, **changes)


def changed(clip, **changes):
    """The clip with other fields, and its weights."""
    found = dataclasses.replace(clip, **changes)
    object.__setattr__(found, "weights", clip.weights)
    return found


def still(clip):
    """The face of a clip, without a frame."""
    return frames_of(clip, slice(0, 0))


def cut(clip, sizes):
    """The frames of a clip as clips of these sizes, one after the other."""
    ends = np.cumsum(sizes)
    return [frames_of(clip, slice(end - n, end)) for n, end in zip(sizes, ends, strict=True)]


def frames_of(clip, frames):
    """Some frames of a clip, with their weights."""
    found = dataclasses.replace(clip, offsets=clip.offsets[frames], codes=clip.codes[frames])
    object.__setattr__(found, "weights", clip.weights[frames])
    return found


def with_rig(clip, rig):
    """A plain clip of the same face with another rig, whose weights are to be solved."""
    fields = {field.name: getattr(clip, field.name) for field in dataclasses.fields(clip)}
    return Clip(**fields | {"rig": rig})
