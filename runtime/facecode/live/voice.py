"""What a stream begins with."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from facecode.arrays import Audio
from facecode.audio import SPEECH, load_audio
from facecode.bundle import Bundle
from facecode.clip import Rig
from facecode.errors import SampleError
from facecode.live.plan import Plan
from facecode.loop.engine import Engine
from facecode.loop.part import Part
from facecode.loop.request import Request
from facecode.weights import WeightProblem

PRIMER_S = 3


@dataclass(frozen=True, eq=False)
class Voice:
    """The face, the speech before the stream, and what frames are to hold; it can be shared."""

    engine: Engine
    request: Request
    plan: Plan
    primer: Audio
    """Speech (n_samples,) at the bundle's rate, whole seconds, as if spoken before: a face that
    begins from nothing trembles for seconds, and an encoder that hears nothing but quiet takes it
    for speech."""
    problem: WeightProblem | None
    """None: no weights."""
    styles: tuple[str, ...]
    rig: Rig | None
    n_vertices: int | None
    """None: no offsets."""
    rest_in_quiet: bool = False

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Names (K,) of the weights; none without a rig."""
        return () if self.rig is None or self.problem is None else self.rig.names

    @classmethod
    def of(
        cls,
        engine: Engine,
        bundle: Bundle,
        request: Request,
        problem: WeightProblem | None,
        look_ahead_ms: float | None = None,
        sample: int = 0,
        rest_in_quiet: bool = False,
    ) -> Voice:
        """The voice of a bundle, primed with the first seconds of the packaged recording.

        Raises:
            LookAheadError, SampleError.
        """
        m = bundle.manifest
        heads = {part.name: np.array([_head(part, sample)]) for part in engine.parts}
        return cls(
            engine=engine,
            request=dataclasses.replace(request, heads=heads),
            plan=Plan.of(m, look_ahead_ms),
            primer=load_audio(SPEECH, m.sample_rate)[: PRIMER_S * m.sample_rate],
            problem=problem if all(p.rig_projection is not None for p in engine.parts) else None,
            styles=m.styles,
            rig=bundle.rig,
            n_vertices=m.n_vertices if request.vertices else None,
            rest_in_quiet=rest_in_quiet,
        )


def _head(part: Part, sample: int) -> int:
    if not 0 <= sample < part.n_samples:
        raise SampleError(
            f"got sample {sample} of {part.name}; this bundle gives 0 to {part.n_samples - 1}"
        )
    return sample
