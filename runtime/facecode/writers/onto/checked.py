"""Reads of a JSON tree that others wrote, each checked: a wrong type or index is one clear error.

Comes in: a tree, and what is expected there. Goes out: that, or OntoError.
"""

from __future__ import annotations

from typing import Any

from facecode.errors import OntoError
from facecode.writers.gltf.container import Tree

SHOWN = 80  # characters of a foreign text in a message


def shown(value: object) -> str:
    """A foreign value in a message, short and on one line."""
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def rows(tree: Tree, name: str) -> list[Tree]:
    """The objects of a table; none where the table is not there.

    Raises:
        OntoError
    """
    found = tree.get(name, [])
    if not isinstance(found, list) or not all(isinstance(row, dict) for row in found):
        raise OntoError(f"broken glTF: {name!r} is {shown(found)}; expected a list of objects")
    return found


def part(tree: Tree, name: str) -> Tree:
    """The object under a name; an empty one where it is not there or is another thing.

    For what glTF leaves to others, such as `extras`.
    """
    found = tree.get(name)
    return found if isinstance(found, dict) else {}


def whole(value: Any, what: str, below: int | None = None) -> int:  # noqa: ANN401
    """A whole number from 0, below a limit.

    Raises:
        OntoError
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise OntoError(f"broken glTF: {what} is {shown(value)}; expected a whole number from 0")
    if below is not None and value >= below:
        raise OntoError(f"broken glTF: {what} is {value}; there are {below}, counted from 0")
    return value


def index_in(value: Any, below: int) -> int | None:  # noqa: ANN401
    """A whole number from 0, below a limit; None where it is another thing."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < below:
        return None
    return value


def number(value: Any) -> float:  # noqa: ANN401
    """A number of moderate size; 0 where it is another thing."""
    return float(value) if isinstance(value, int | float) and abs(value) < 1e6 else 0.0
