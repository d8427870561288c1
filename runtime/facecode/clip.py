"""A face in motion as plain data: what the loop makes, what writers take.

Knows nothing of bundles, files or formats.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from facecode.arrays import Audio, Codes, Colours, Faces, Float32, Offsets, Template
from facecode.errors import CodesError, NoRigError, NoVerticesError
from facecode.weights import solve_weights


@dataclass(frozen=True, eq=False)
class Rig:
    """Named face units: a weight of 1 moves the template by the unit's deltas."""

    names: tuple[str, ...]
    """K names, ARKit's where the rig is one."""
    deltas: Float32
    """(K, V, 3) float32, in the unit of the clip."""

    def __repr__(self) -> str:
        return f"<Rig: {len(self.names)} units of {self.deltas.shape[1]:,} vertices>"


@dataclass(frozen=True, eq=False)
class Clip:
    """T frames of V vertices and H codes, with what is known of the face and of the speech."""

    offsets: Offsets
    """(T, V, 3) float32, from the template, in `unit`; (T, 0, 3) of a clip of weights alone."""
    codes: Codes
    """(T, H) int64, rows of the codebook; several parts side by side."""
    fps: float
    """Frames per second."""
    template: Template
    """(V, 3) float32, the neutral face."""
    faces: Faces | None = None
    """(F, 3) int32 triangles, where the bundle knows its topology."""
    colours: Colours | None = None
    """(V, 3) uint8 sRGB, where the bundle has colours."""
    audio: Audio | None = None
    """The speech, (n_samples,) float32 mono at `sample_rate`."""
    sample_rate: int | None = None
    """Of `audio`, in Hz."""
    parts: Mapping[str, int] = field(default_factory=dict)
    """Codes a frame of each part of the face, in the order of their columns in `codes`."""
    unit: str = ""
    """The unit of length, in words."""
    metres_per_unit: float | None = None
    """What writers multiply by; None: not known."""
    up_axis: str | None = None
    """`x`, `y` or `z`; None: not known."""
    styles: Mapping[str, float] = field(default_factory=dict)
    """The weight of each style that was asked for."""
    mode: str = ""
    """How it was animated, `exact` or `window`, where that is known."""
    lip_pair: tuple[int, int] | None = None
    """Upper and lower inner-lip vertex; their distance is the mouth opening."""
    rig: Rig | None = None
    """The face units of the bundle, where it has them."""
    known_weights: Float32 | None = None
    """(T, K) of the rig's units, where they were had without vertices."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary(self.n_frames)}>"

    def summary(self, n_frames: int) -> str:
        """So many frames of this face in a line: length, vertices, codes by part, units, mode."""
        parts = ", ".join(f"{name} {width}" for name, width in self.parts.items())
        facts = [
            f"{n_frames:,} frames at {self.fps:g} fps ({n_frames / self.fps:.2f} s)",
            f"{len(self.template):,} vertices" + ("" if self.has_vertices else " (weights alone)"),
            f"codes: {parts}" if parts else "",
            f"{len(self.rig.names)} face units" if self.rig is not None else "no face units",
            f"{self.mode} mode" if self.mode else "",
        ]
        return ", ".join(filter(None, facts))

    def codes_of(self, part: str) -> Codes:
        """The codes (T, H) of one part.

        Raises:
            CodesError: no such part.
        """
        if part not in self.parts:
            raise CodesError(f"got part {part!r}; the parts are {', '.join(self.parts)}")
        names = list(self.parts)
        start = sum(self.parts[name] for name in names[: names.index(part)])
        return self.codes[:, start : start + self.parts[part]]

    @cached_property
    def weights(self) -> Float32:
        """Weights (T, K) float32 in [0, 1] of the rig's units, nearest to the motion.

        Solved once a clip; see `facecode.weights`.

        Raises:
            NoRigError: the face units are not known.
        """
        rig = self._known_rig
        if self.known_weights is not None:
            return self.known_weights
        return solve_weights(self.offsets, rig.deltas)

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names (K,) of the columns of `weights`.

        Raises:
            NoRigError: the face units are not known.
        """
        return self._known_rig.names

    @property
    def _known_rig(self) -> Rig:
        if self.rig is None:
            raise NoRigError.to_write("weights")
        return self.rig

    @property
    def vertices(self) -> Offsets:
        """Positions (T, V, 3) float32: template plus offsets, a new array each time.

        Raises:
            NoVerticesError: a clip of weights alone.
        """
        if not self.has_vertices:
            raise NoVerticesError.to_give("vertices")
        return self.offsets + self.template

    @property
    def has_vertices(self) -> bool:
        """False of a clip of weights alone."""
        n_vertices: int = self.offsets.shape[1]
        return n_vertices == len(self.template)

    @property
    def n_frames(self) -> int:
        """T."""
        return len(self.codes)

    @property
    def duration_s(self) -> float:
        """Length in seconds."""
        return len(self.codes) / self.fps
