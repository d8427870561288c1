"""Speech on somebody's own avatar: their glTF, .glb or VRM comes back with an animation added.

Comes in: weights of face units, and a file whose morph targets bear the units' names in any
spelling. Goes out: a .glb with one animation more, on every mesh that has some of them, and all
else as it was: the bytes of the first buffer stay where they are, the JSON keeps its content and
order. Meshes, shapes and textures are not read, so they may be compressed. Knows nothing of speech.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np

from facecode.arrays import Float32
from facecode.errors import OntoError
from facecode.writers.gltf.animation import Channel, add_animation
from facecode.writers.gltf.container import Tree, to_json, write_container
from facecode.writers.gltf.document import Document
from facecode.writers.onto.checked import number, part, rows, shown
from facecode.writers.onto.gather import gather
from facecode.writers.onto.report import MeshReport, OntoReport
from facecode.writers.onto.source import Source, blocks, read_source
from facecode.writers.onto.targets import DrivenMesh, driven_meshes, label_of, node_labels

ANIMATION = "facecode"
MOST_BYTES = 1 << 30
"""Of keys: an hour of 60 targets on 4 meshes takes a tenth."""
LISTED = 60  # names in an error


class Weighted(Protocol):
    """What moves an avatar; a `Clip` of a bundle with face units is one."""

    @property
    def weights(self) -> Float32:
        """(T, K) float32 in [0, 1]."""
        ...

    @property
    def weight_names(self) -> Sequence[str]:
        """K names."""
        ...

    @property
    def fps(self) -> float:
        """Frames per second."""
        ...


def check_avatar(source: Path, units: Sequence[str]) -> None:
    """Refuse an avatar that no unit of these names moves; what it points at is not looked for.

    Raises:
        AvatarNotFoundError: no such file.
        OntoError: it cannot be read, or none of its morph targets bears the name of a unit.
    """
    _matched(read_source(source), units)


def onto(motion: Weighted, source: Path, file: BinaryIO) -> OntoReport:
    """Write the avatar of `source` with the motion added, as a .glb, to an open binary file.

    Args:
        motion: weights (T, K) of named units; any object that has `weights`, `weight_names`, `fps`.
        source: a .glb, .vrm, or .gltf with what it points at beside it.
        file: need not seek.

    Raises:
        NoRigError: the motion has no units.
        AvatarNotFoundError: no such file.
        OntoError: it cannot be read, or none of its morph targets bears the name of a unit.
        OutputWriteError: over 4 GiB.
    """
    names = list(motion.weight_names)
    read = read_source(source)
    meshes, matched = _matched(read, names)
    gathered = gather(read)
    document = Document(read.tree, gathered.n_bytes)
    title = _free_name(rows(read.tree, "animations"))
    before = _moved_already(read.tree, [node for mesh in matched for node in mesh.nodes])
    channels = _channels(read.tree, matched, names, np.asarray(motion.weights, np.float32))
    add_animation(document, title, motion.fps, channels)
    read.tree["buffers"][0]["byteLength"] = document.n_bytes
    text = _json(read)
    pieces = blocks([*gathered.pieces, *document.pieces])
    write_container(file, text, pieces, document.n_bytes, read.after.blocks(), read.after.length)
    labels = node_labels(rows(read.tree, "nodes"))
    return OntoReport(
        source.name,
        tuple(names),
        tuple(_mesh_report(mesh, labels) for mesh in meshes),
        title,
        tuple(before),
        tuple(gathered.relocated),
    )


def _matched(read: Source, units: Sequence[str]) -> tuple[list[DrivenMesh], list[DrivenMesh]]:
    """All meshes with morph targets, and those that units move."""
    meshes = driven_meshes(read.tree, units)
    matched = [mesh for mesh in meshes if mesh.driven and mesh.nodes]
    if not matched:
        raise _nothing_matched(read.path, meshes, units)
    return meshes, matched


def _json(source: Source) -> bytes:
    try:
        return to_json(source.tree)
    except (ValueError, RecursionError) as error:
        raise OntoError(f"the JSON of {source.path.name} cannot be written: {error}") from error


def _channels(
    tree: Tree, meshes: list[DrivenMesh], names: list[str], weights: Float32
) -> Iterator[Channel]:
    """For each node that shows a mesh, its targets at each frame; others keep their weight."""
    column = {name: index for index, name in enumerate(names)}
    n_bytes = 4 * len(weights) * sum(len(mesh.targets) * len(mesh.nodes) for mesh in meshes)
    if n_bytes > MOST_BYTES:
        raise OntoError(f"the animation would take {n_bytes >> 20} MiB; at most 1,024 are written")
    for mesh in meshes:
        for node in mesh.nodes:
            still = tree["nodes"][node].get("weights", tree["meshes"][mesh.index].get("weights"))
            values = np.tile(_rest_weights(still, len(mesh.targets)), (len(weights), 1))
            for unit, targets in mesh.driven.items():
                for target, share in targets:
                    values[:, target] = weights[:, column[unit]] * np.float32(share)
            yield node, "weights", values


def _rest_weights(stated: Any, n_targets: int) -> Float32:  # noqa: ANN401
    still = [number(each) for each in stated[:n_targets]] if isinstance(stated, list) else []
    return np.array(still + [0.0] * (n_targets - len(still)), np.float32)


def _free_name(animations: list[Tree]) -> str:
    taken = {row.get("name") for row in animations if isinstance(row.get("name"), str)}
    further = (f"{ANIMATION} {number}" for number in range(2, len(taken) + 3))
    return next(name for name in (ANIMATION, *further) if name not in taken)


def _moved_already(tree: Tree, nodes: list[int]) -> list[str]:
    """The animations that move weights of the nodes."""
    found = []
    for index, animation in enumerate(rows(tree, "animations")):
        targets = [part(channel, "target") for channel in rows(animation, "channels")]
        if any(t.get("path") == "weights" and t.get("node") in nodes for t in targets):
            found.append(label_of(animation, f"animation {index}"))
    return found


def _nothing_matched(source: Path, meshes: list[DrivenMesh], units: Sequence[str]) -> OntoError:
    if not meshes:
        return OntoError(f"{source.name} has no morph targets; expected ARKit's 52 shapes")
    if any(mesh.driven for mesh in meshes):
        return OntoError(f"no node of {source.name} shows the meshes that have face units")
    names = [name for mesh in meshes for name in mesh.targets if name]
    listed = ", ".join(shown(name) for name in names[:LISTED]) or "none has a name"
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return OntoError(
        f"no morph target of {source.name} bears the name of a face unit such as "
        f"{units[0]!r}; its targets: {listed}{more}. Rename them, or add ARKit's 52 shapes"
    )


def _mesh_report(mesh: DrivenMesh, labels: list[str]) -> MeshReport:
    names = [name or f"target {index}" for index, name in enumerate(mesh.targets)]
    moving = {target for targets in mesh.driven.values() for target, _ in targets}
    return MeshReport(
        mesh.name,
        tuple(labels[node] for node in mesh.nodes),
        {unit: tuple(names[target] for target, _ in to) for unit, to in mesh.driven.items()},
        tuple(name for index, name in enumerate(names) if index not in moving),
        tuple(sorted(mesh.by_expression)),
    )
