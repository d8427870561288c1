"""What an animation on somebody's avatar moves, and what not, in both directions.

Knows nothing of files.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class MeshReport:
    """A mesh with morph targets."""

    name: str
    nodes: tuple[str, ...]
    """That show it; none: it is not animated."""
    matched: Mapping[str, tuple[str, ...]]
    """For each unit, the targets that it moves."""
    unmatched: tuple[str, ...]
    """Targets that no unit moves; they keep their weight."""
    by_expression: tuple[str, ...] = ()
    """Units that an expression of the VRM told."""


@dataclass(frozen=True)
class OntoReport:
    """What matched."""

    avatar: str
    units: tuple[str, ...]
    """The names that were looked for."""
    meshes: tuple[MeshReport, ...]
    """All that have morph targets."""
    animation: str
    """The name of the one that was added."""
    kept: tuple[str, ...] = ()
    """Animations that were there before and move the same nodes."""
    moved_in: tuple[str, ...] = ()
    """Buffers and images that lay outside the file."""

    @property
    def matched(self) -> tuple[str, ...]:
        """The units that move something."""
        driven = {unit for mesh in self.meshes if mesh.nodes for unit in mesh.matched}
        return tuple(unit for unit in self.units if unit in driven)

    @property
    def unmatched(self) -> tuple[str, ...]:
        """The units that move nothing."""
        driven = set(self.matched)
        return tuple(unit for unit in self.units if unit not in driven)

    def describe(self) -> str:
        """The report as lines of text."""
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        yield f"{self.avatar}: {len(self.matched)} of {len(self.units)} face units move it"
        for mesh in self.meshes:
            yield from _mesh_lines(mesh)
        if self.unmatched:
            yield f"  units without a target: {', '.join(self.unmatched)}"
        yield f"  animation {self.animation!r} added"
        if self.kept:
            kept = ", ".join(map(repr, self.kept))
            yield f"  kept, and moves the same meshes: {kept}; play {self.animation!r} alone"
        yield from (f"  {line}" for line in self.moved_in)


def _mesh_lines(mesh: MeshReport) -> Iterator[str]:
    n_targets = sum(map(len, mesh.matched.values()))
    where = f" on {', '.join(mesh.nodes)}" if mesh.nodes else ""
    yield f"  {mesh.name}{where}: {len(mesh.matched)} units, {n_targets} targets"
    if not mesh.nodes:
        yield "    no node shows it, so it is not animated"
    if mesh.by_expression:
        yield f"    told by the avatar's expressions: {', '.join(mesh.by_expression)}"
    if mesh.unmatched:
        yield f"    targets without a unit: {', '.join(mesh.unmatched)}"
