"""Tracked mouths as a teacher needs them: all that landmarks say of lips, jaw and corners.

Comes in: a folder as `data.tracks` describes it, with the landmarks and scores named below. Goes
out: per clip the measures of `head.mouth_fit`, in mm and less those of the same clip at rest, so
that how far off the camera the face sits cancels.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from facecode_exporter.data.tracks import (
    CORNERS,
    EYE_CORNERS,
    EYES_MM,
    LOWER_LIP,
    UPPER_LIP,
    Track,
    find_archive,
    read_tracks,
)
from facecode_exporter.errors import DataSetError
from facecode_exporter.head.mouth_fit import ROUNDING

UPPER_EDGE, LOWER_EDGE, CHIN, BELOW_NOSE = 0, 17, 152, 2
"""Numbers of MediaPipe's face mesh: outer edges of the lips, chin, where nose and lip meet."""
AT_REST_MM = 1.0
EDGE_S = 0.32
"""A clip is at rest where its gap is below AT_REST_MM this near its start or end."""

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MouthTrack:
    """One clip."""

    track: Track
    measures_mm: Points
    """(T, 7) in the order of `head.mouth_fit.MEASURES`, less those at rest; the gap as it is"""
    rounding: Points
    """(T, 2) scores of the units of `head.mouth_fit.ROUNDING`, less those at rest"""


def read_mouth_tracks(folder: Path, split: str) -> list[MouthTrack]:
    """The clips of a split, in order of name.

    Raises:
        DataSetError: files that are missing or of another form.
    """
    tracks = read_tracks(folder, split)
    archive = find_archive(folder)
    try:
        with np.load(archive, allow_pickle=False) as data:
            rows = {
                f"{speaker}_{clip}": slice(int(start), int(start + length))
                for speaker, clip, start, length in zip(
                    *(data[key] for key in ("speaker", "clip", "start", "length")), strict=True
                )
            }
            columns = {int(number): i for i, number in enumerate(data["landmark_index"])}
            named = data["blendshape_names"].tolist()
            scores = data["blendshapes"][:, [named.index(unit) for unit in ROUNDING]]
            wanted = (UPPER_LIP, LOWER_LIP, UPPER_EDGE, LOWER_EDGE, CHIN, BELOW_NOSE)
            picked = [columns[number] for number in (*wanted, *CORNERS, *EYE_CORNERS)]
            points = data["landmarks_px32"][:, picked, :2]
    except (KeyError, ValueError, OSError) as error:
        raise DataSetError(
            f"{archive}: a teacher needs lips, chin, nose and the scores of "
            f"{', '.join(ROUNDING)} ({error}); see docs/evaluation.md"
        ) from error
    found = []
    for track in tracks:
        own = rows[track.name]
        measures = measured_mm(points[own].astype(np.float64))
        rest = _at_rest(measures[:, 0], round(EDGE_S * track.fps))
        measures[:, 1:] -= np.median(measures[rest, 1:], axis=0)
        rounding = scores[own].astype(np.float64)
        rounding = rounding - np.median(rounding[rest], axis=0)
        found.append(MouthTrack(track, measures, rounding))
    return found


def measured_mm(points: Points) -> Points:
    """(T, 7) the measures of (T, 10, 2) landmarks in pixels, y down.

    Sideways is along the line of the eyes. Heights are told from where nose and lip meet, which
    moves with the head and not with the mouth; the middle distance of the eyes gives the scale.
    """
    upper, lower, upper_edge, lower_edge, chin, nose, *corners, left_eye, right_eye = np.moveaxis(
        points, 1, 0
    )
    across = right_eye - left_eye
    apart = np.linalg.norm(across, axis=1, keepdims=True)
    down = np.stack([-across[:, 1], across[:, 0]], axis=1) / apart
    scale = EYES_MM / np.median(apart)

    def height(point: Points) -> Points:
        return np.asarray(-scale * ((point - nose) * down).sum(axis=1))

    return np.stack(
        [
            scale * np.linalg.norm(lower - upper, axis=1),
            scale * np.linalg.norm(corners[1] - corners[0], axis=1),
            height(upper),
            height(chin),
            (height(corners[0]) + height(corners[1])) / 2,
            height(upper_edge) - height(upper),
            height(lower) - height(lower_edge),
        ],
        axis=1,
    )


def _at_rest(gap_mm: Points, edge: int) -> NDArray[np.int64]:
    """Frames of shut lips near the ends; of the whole clip, or the least open one, if none is."""
    shut = np.flatnonzero(gap_mm < AT_REST_MM)
    near = shut[(shut < edge) | (shut >= len(gap_mm) - edge)]
    for frames in (near, shut):
        if len(frames):
            return frames
    return np.array([int(np.argmin(gap_mm))])
