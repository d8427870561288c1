"""Values as USD's text format spells them.

Knows nothing of faces.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np

from facecode.arrays import AnyArray

ESCAPES = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\r": "\\r", "\t": "\\t"}


def quoted(text: str) -> str:
    """A string or token."""
    return '"' + "".join(ESCAPES.get(letter, letter) for letter in text) + '"'


def tokens(names: Iterable[str]) -> str:
    """An array of tokens."""
    return f"[{', '.join(map(quoted, names))}]"


def identifiers(names: Sequence[str]) -> list[str]:
    """Names of prims: letters, digits and underscores, no two alike."""
    found: list[str] = []
    taken = set(names)  # a name that is valid stays with its owner
    for name in names:
        valid = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
        valid = f"_{valid}" if valid[0].isdigit() else valid
        unique, count = valid, 1
        while unique in found or (unique != name and unique in taken):
            count += 1
            unique = f"{valid}_{count}"
        found.append(unique)
    return found


def numbers(values: AnyArray, form: str = "%.9g") -> str:
    """An array of numbers; nine digits give back every float32."""
    flat = np.ravel(values).tolist()
    return f"[{','.join([form] * len(flat)) % tuple(flat)}]"


def vectors(values: AnyArray, form: str = "%.9g") -> str:
    """An array (n, 3) of vectors."""
    each = f"({form},{form},{form})"
    return f"[{','.join([each] * len(values)) % tuple(np.ravel(values).tolist())}]"


def prim(kind: str, name: str, lines: Iterable[str], metadata: Iterable[str] = ()) -> list[str]:
    """The lines of a prim with its properties and children."""
    facts = [f"    {fact}" for fact in metadata]
    opening = [f'def {kind} "{name}" (', *facts, ")"] if facts else [f'def {kind} "{name}"']
    return [*opening, "{", *(f"    {line}" for line in lines), "}"]
