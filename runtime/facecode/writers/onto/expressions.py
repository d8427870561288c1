"""The expressions of a VRM avatar: names for weights of morph targets.

Comes in: a JSON tree. Goes out: name and binds of each, as VRM 0 (`blendShapeMaster`) and VRM 1
(`expressions`) say them. A bind that points nowhere is left out: it moves nothing.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from facecode.writers.gltf.container import Tree
from facecode.writers.onto.checked import index_in, number, part, rows

Bind: TypeAlias = tuple[int, int, float]
"""(mesh, morph target, weight in [0, 1])"""


def expressions(tree: Tree) -> list[tuple[str, list[Bind]]]:
    """Names and binds, in the order of the file; none where it is no VRM.

    Raises:
        OntoError: a table of the glTF is broken.
    """
    extensions = part(tree, "extensions")
    return _of_vrm_0(tree, part(extensions, "VRM")) + _of_vrm_1(tree, part(extensions, "VRMC_vrm"))


def _of_vrm_0(tree: Tree, vrm: Tree) -> list[tuple[str, list[Bind]]]:
    n_meshes = len(rows(tree, "meshes"))
    found = []
    for group in _objects(part(vrm, "blendShapeMaster").get("blendShapeGroups")):
        binds = []
        for bind in _objects(group.get("binds")):
            mesh = index_in(bind.get("mesh"), n_meshes)
            binds += _bind(mesh, bind, number(bind.get("weight")) / 100)
        found.append((str(group.get("name", "")), binds))
    return found


def _of_vrm_1(tree: Tree, vrm: Tree) -> list[tuple[str, list[Bind]]]:
    nodes, n_meshes = rows(tree, "nodes"), len(rows(tree, "meshes"))
    found = []
    for kind in ("preset", "custom"):
        named = part(part(vrm, "expressions"), kind)
        for name in named:
            binds = []
            for bind in _objects(part(named, name).get("morphTargetBinds")):
                node = index_in(bind.get("node"), len(nodes))
                mesh = None if node is None else index_in(nodes[node].get("mesh"), n_meshes)
                binds += _bind(mesh, bind, number(bind.get("weight")))
            found.append((name, binds))
    return found


def _bind(mesh: int | None, bind: Tree, weight: float) -> list[Bind]:
    target = index_in(bind.get("index"), 1 << 32)
    return [] if mesh is None or target is None else [(mesh, target, weight)]


def _objects(value: Any) -> list[Tree]:  # noqa: ANN401
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []
