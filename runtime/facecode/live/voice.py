"""What a stream begins with."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from facecode.arrays import Audio
from facecode.audio import SPEECH, load_audio
from facecode.bundle import Bundle
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
    """Speech (n_samples,) at the bundle's rate, as if spoken before: a face that begins from
    nothing trembles for seconds."""
    problem: WeightProblem | None
    """None: no weights."""
    styles: tuple[str, ...]
    weight_names: tuple[str, ...]
    n_vertices: int | None
    """None: no offsets."""

    @classmethod
    def of(
        cls,
        engine: Engine,
        bundle: Bundle,
        request: Request,
        problem: WeightProblem | None,
        look_ahead_ms: float | None = None,
        sample: int = 0,
    ) -> Voice:
        """The voice of a bundle, primed with the first seconds of the packaged recording.

        Raises:
            LookAheadError, SampleError.
        """
        m, rig = bundle.manifest, bundle.rig
        heads = {part.name: np.array([_head(part, sample)]) for part in engine.parts}
        return cls(
            engine=engine,
            request=dataclasses.replace(request, heads=heads),
            plan=Plan.of(m, look_ahead_ms),
            primer=load_audio(SPEECH, m.sample_rate)[: PRIMER_S * m.sample_rate],
            problem=problem,
            styles=m.styles,
            weight_names=rig.names if rig is not None and problem is not None else (),
            n_vertices=m.n_vertices if request.vertices else None,
        )


def _head(part: Part, sample: int) -> int:
    if not 0 <= sample < part.n_samples:
        raise SampleError(
            f"got sample {sample} of {part.name}; this bundle gives 0 to {part.n_samples - 1}"
        )
    return sample
