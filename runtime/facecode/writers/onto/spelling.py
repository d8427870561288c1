"""Names of face units as others spell them: `jawOpen` is `JawOpen`, `jaw_open`, `head.JAWOPEN`.

Comes in: the names of units, and of the shapes of a mesh. Goes out: which shape is which unit.
Knows nothing of files.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+|[^\W\d_a-zA-Z]+")
SIDES = ("left", "right")
LONGEST = 200  # characters of a name; longer ones are nobody's spelling
_ASIDE = frozenset(
    ["left", "right", "l", "r", "upper", "lower", "inner", "outer", "up", "down", "top", "bottom"]
)
"""Words that make another shape of what follows: `upper_mouthLeft` is not `mouthLeft`."""
_AGAINST = frozenset(
    ["not", "no", "anti", "inverse", "inverted", "negative", "neg", "minus", "corrective", "fix"]
)


@dataclass(frozen=True)
class _Hit:
    """A shape whose name ends in a unit's."""

    shape: int
    unit: str
    prefix: str
    half: str
    """The side, of a shape that is one half of a unit without sides (`cheekPuff_L`)."""


class Spellings:
    """The units, by every spelling of their names."""

    def __init__(self, units: Sequence[str]) -> None:
        self._units: dict[str, tuple[str, str]] = {}
        words = {unit: _words(unit) for unit in units}
        for unit, own in words.items():
            self._units.setdefault("".join(own), (unit, ""))
        for unit, own in words.items():
            if own and own[-1] in SIDES:
                for spelling in _sided(own[:-1], own[-1]):
                    self._units.setdefault(spelling, (unit, ""))
        for unit, own in words.items():
            if own and own[-1] not in SIDES:
                for side in SIDES:
                    for spelling in _sided(own, side):
                        self._units.setdefault(spelling, (unit, side))

    def assign(self, shapes: Sequence[str]) -> dict[str, list[int]]:
        """For each unit that is there, its shape; both halves, in order, where it has two.

        Of several spellings of one unit the one without a prefix is taken, then the prefix that
        most of the mesh's shapes have. A combination of two units is neither.

        Args:
            shapes: the names of a mesh's shapes; empty where one has none.
        """
        hits = [hit for index, name in enumerate(shapes) if (hit := self._find(index, name))]
        often = Counter(hit.prefix for hit in hits)
        by_unit: Mapping[str, dict[str, list[_Hit]]] = defaultdict(lambda: defaultdict(list))
        for hit in hits:
            by_unit[hit.unit][hit.half].append(hit)

        def first(found: list[_Hit]) -> int:
            return min(found, key=lambda h: (h.prefix != "", -often[h.prefix], h.shape)).shape

        assigned = {}
        for unit, halves in by_unit.items():
            chosen = [halves[""]] if "" in halves else [halves[s] for s in SIDES if s in halves]
            assigned[unit] = sorted(map(first, chosen))
        return assigned

    def _find(self, shape: int, name: str) -> _Hit | None:
        words = _words(name) if len(name) <= LONGEST else []
        for start in range(len(words)):
            unit, half = self._units.get("".join(words[start:]), ("", ""))
            if unit:
                prefix = words[:start]
                return None if self._changes(prefix) else _Hit(shape, unit, "_".join(prefix), half)
        return None

    def _changes(self, prefix: list[str]) -> bool:
        """Whether what follows the prefix is another shape."""
        if not prefix:
            return False
        return (
            prefix[-1] in _ASIDE
            or not _AGAINST.isdisjoint(prefix)
            or any(
                "".join(prefix[i:j]) in self._units
                for i in range(len(prefix))
                for j in range(i + 1, len(prefix) + 1)
            )
        )


def _words(name: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(name)]


def _sided(base: list[str], side: str) -> Iterator[str]:
    """The spellings of a name with its side at the end, in front, or after the first word."""
    for spelled in (side, side[0]):
        yield "".join([*base, spelled])
        if len(base) > 1:  # `Left_mouth` may be anything
            yield "".join([spelled, *base])
            yield "".join([base[0], spelled, *base[1:]])
