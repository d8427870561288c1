"""In which frames is the true mouth open? The mask of CDFace's lip losses."""

from __future__ import annotations

from collections.abc import Hashable, Sequence

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import AnyArray
from facecode_exporter.measures.lip_sync import FULL_PERCENTILE


def open_frames(
    openings: Sequence[AnyArray], subjects: Sequence[Hashable], closed_below: float
) -> list[NDArray[np.bool_]]:
    """(T,) of each clip: True where the opening exceeds `closed_below` of the subject's full one.

    Args:
        openings: (T,) distance of a lip pair less its distance at rest, clip by clip.
        subjects: who speaks in each clip; the full opening is the 95th percentile over all frames
            of the same subject.
        closed_below: share of the full opening.
    """
    full = {
        subject: float(
            np.percentile(
                np.concatenate(
                    [o for o, s in zip(openings, subjects, strict=True) if s == subject]
                ),
                FULL_PERCENTILE,
            )
        )
        for subject in set(subjects)
    }
    return [
        np.asarray(opening > closed_below * full[subject])
        for opening, subject in zip(openings, subjects, strict=True)
    ]
