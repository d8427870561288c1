"""What a stream begins with."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from facecode.bundle import Bundle
from facecode.clip import Rig
from facecode.errors import SampleError
from facecode.live.plan import Plan
from facecode.live.primed import PrimedLoops, primer_of
from facecode.loop.engine import Engine
from facecode.loop.part import Part
from facecode.loop.request import Request
from facecode.weights import WeightProblem


@dataclass(frozen=True, eq=False)
class Voice:
    """The face, the speech before the stream, and what frames are to hold; it can be shared."""

    primed: PrimedLoops
    request: Request
    plan: Plan
    problem: WeightProblem | None
    """None: no weights."""
    styles: tuple[str, ...]
    rig: Rig | None
    n_vertices: int | None
    """None: no offsets."""
    rest_in_quiet: bool = False

    @property
    def parts(self) -> tuple[Part, ...]:
        """Of the face."""
        return self.primed.engine.parts

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names (K,) of the weights; none without a rig."""
        return () if self.rig is None or self.problem is None else self.rig.names


class Voices:
    """The voices of a bundle, which share their primed loops."""

    def __init__(self, engine: Engine, bundle: Bundle, problem: WeightProblem | None) -> None:
        """See `primer_of` for errors."""
        known = all(part.rig_projection is not None for part in engine.parts)
        self._problem = problem if known else None
        self._primed, self._bundle = PrimedLoops(engine, primer_of(bundle)), bundle

    def voice(
        self,
        request: Request,
        look_ahead_ms: float | None = None,
        sample: int = 0,
        rest_in_quiet: bool = False,
    ) -> Voice:
        """A voice for one stream.

        Raises:
            LookAheadError, SampleError.
        """
        m = self._bundle.manifest
        parts = self._primed.engine.parts
        heads = {part.name: np.array([_head(part, sample)]) for part in parts}
        return Voice(
            primed=self._primed,
            request=dataclasses.replace(request, heads=heads),
            plan=Plan.of(m, look_ahead_ms),
            problem=self._problem,
            styles=m.styles,
            rig=self._bundle.rig,
            n_vertices=m.n_vertices if request.vertices else None,
            rest_in_quiet=rest_in_quiet,
        )


def _head(part: Part, sample: int) -> int:
    if not 0 <= sample < part.n_samples:
        raise SampleError(
            f"got sample {sample} of {part.name}; this bundle gives 0 to {part.n_samples - 1}"
        )
    return sample
