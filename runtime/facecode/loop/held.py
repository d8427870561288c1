"""A part whose codes are given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from facecode.arrays import Codes, Float32, Vectors
from facecode.errors import ModeError
from facecode.loop.codes import check_codes
from facecode.loop.part import Part
from facecode.loop.protocols import Final
from facecode.speech import Memory


class HeldPart:
    """A part whose codes are given: (n_clips, T, H), one row a clip. All frames are final."""

    def __init__(self, part: Part, codes: Codes) -> None:
        self._part, self._codes, self._given = part, codes, False

    @classmethod
    def of(cls, part: Part, codes: Codes, memories: Sequence[Memory]) -> HeldPart:
        """The loop that gives `codes` (T, H) over the one clip of `memories`.

        Raises:
            CodesError: codes of another length.
            ModeError: several clips.
        """
        if len(memories) != 1:
            raise ModeError(f"got codes to hold and {len(memories)} recordings; expected one")
        return cls(part, check_codes(codes, part, memories[0].n_frames)[None])

    def step(self, step: int, n_clips: int, conditions: Mapping[str, Vectors]) -> Codes:  # noqa: ARG002
        """See `PartLoop`."""
        return self._codes[:n_clips, step]

    def settle(self) -> None:
        """See `PartLoop`."""

    def restyle(self, weights: Float32) -> None:
        """See `PartLoop`."""

    def finish(self) -> None:
        """See `PartLoop`."""

    def take_final(self) -> list[Final]:
        """See `PartLoop`: the clip is decoded as a whole, at the first frame."""
        if self._given:
            return []
        self._given = True
        return [(slice(0, len(self._codes)), self._part.hidden_of(self._codes))]
