"""The morph targets of a foreign file, their names, and the face units that they are.

Comes in: a JSON tree. Goes out: for each mesh its targets' names, and what each unit moves. Names
are where exporters leave them: `extras.targetNames` of the mesh or of a primitive, `extras.name`
of the target, the name of an accessor. Where they tell nothing, the expressions of a VRM may.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from facecode.errors import OntoError
from facecode.writers.gltf.container import Tree
from facecode.writers.onto.checked import index_in, part, rows, whole
from facecode.writers.onto.expressions import expressions
from facecode.writers.onto.spelling import Spellings

MOST = 4096
"""Targets of a mesh; no renderer shows as many."""


@dataclass
class DrivenMesh:
    """A mesh with morph targets."""

    index: int
    name: str
    nodes: list[int]
    """That show it."""
    targets: list[str]
    """Their names; empty where one has none."""
    driven: dict[str, list[tuple[int, float]]] = field(default_factory=dict)
    """For each unit: targets, and their weights at a weight of 1 of the unit."""
    by_expression: set[str] = field(default_factory=set)
    """The units that a VRM's expressions told, not the targets' names."""


def driven_meshes(tree: Tree, units: Sequence[str]) -> list[DrivenMesh]:
    """The meshes that have targets.

    Raises:
        OntoError: the tree is broken, or a mesh has over MOST targets.
    """
    accessors, nodes_of = rows(tree, "accessors"), _nodes_of(tree)
    found = []
    for index, mesh in enumerate(rows(tree, "meshes")):
        targets = _target_names(mesh, index, accessors)
        if targets:
            label = label_of(mesh, f"mesh {index}")
            found.append(DrivenMesh(index, label, nodes_of.get(index, []), targets))
    spellings = Spellings(units)
    for target_mesh in found:
        for unit, chosen in spellings.assign(target_mesh.targets).items():
            target_mesh.driven[unit] = [(target, 1.0) for target in chosen]
    _ask_expressions(tree, found, spellings)
    return found


def _nodes_of(tree: Tree) -> dict[int, list[int]]:
    """The nodes that show each mesh."""
    n_meshes = len(rows(tree, "meshes"))
    found: dict[int, list[int]] = {}
    for index, node in enumerate(rows(tree, "nodes")):
        if "mesh" in node:
            mesh = whole(node["mesh"], f"mesh of node {index}", n_meshes)
            found.setdefault(mesh, []).append(index)
    return found


def node_labels(nodes: list[Tree]) -> list[str]:
    """A name for each node: its own, its parent's, or its number."""
    labels = [label_of(node, "") for node in nodes]
    for parent, node in enumerate(nodes):
        children = node.get("children")
        for child in children if isinstance(children, list) else []:
            index = index_in(child, len(nodes))
            if index is not None and not labels[index]:
                labels[index] = label_of(nodes[parent], "")
    return [label or f"node {index}" for index, label in enumerate(labels)]


def label_of(row: Tree, otherwise: str) -> str:
    """The name of a row of a table."""
    name = row.get("name")
    return name if isinstance(name, str) and name else otherwise


def _target_names(mesh: Tree, index: int, accessors: list[Tree]) -> list[str]:
    primitives = rows(mesh, "primitives")
    targets_of = [rows(primitive, "targets") for primitive in primitives]
    count = max(map(len, targets_of), default=0)
    if count > MOST:
        raise OntoError(f"mesh {index} has {count} morph targets; at most {MOST} are taken")
    names = [""] * count
    for stated in _stated_names([mesh, *primitives], targets_of, accessors):
        for target, name in enumerate(stated[:count]):
            if not names[target] and isinstance(name, str):
                names[target] = name
    return names


def _stated_names(
    owners: list[Tree], targets_of: list[list[Tree]], accessors: list[Tree]
) -> Iterator[list[Any]]:
    """Lists of names, the best place first."""
    for owner in owners:
        listed = part(owner, "extras").get("targetNames")
        yield listed if isinstance(listed, list) else []
    for targets in targets_of:
        yield [part(target, "extras").get("name") for target in targets]
    for targets in targets_of:
        yield [_accessor_name(target, accessors) for target in targets]


def _accessor_name(target: Tree, accessors: list[Tree]) -> Any:  # noqa: ANN401
    if "POSITION" not in target:
        return None
    return accessors[whole(target["POSITION"], "a target's POSITION", len(accessors))].get("name")


def _ask_expressions(tree: Tree, meshes: list[DrivenMesh], spellings: Spellings) -> None:
    """Units that no target's name told, where an expression of a VRM bears their name."""
    told = {unit for mesh in meshes for unit in mesh.driven}
    by_index = {mesh.index: mesh for mesh in meshes}
    found = expressions(tree)
    for unit, chosen in spellings.assign([name for name, _ in found]).items():
        for mesh_index, target, weight in (bind for i in chosen for bind in found[i][1]):
            mesh = by_index.get(mesh_index)
            if unit not in told and mesh is not None and target < len(mesh.targets):
                mesh.driven.setdefault(unit, []).append((target, weight))
                mesh.by_expression.add(unit)
