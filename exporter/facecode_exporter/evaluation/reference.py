"""Motion to compare with: of the corpus's rules, or from a folder of the user's.

Comes in: a recording with its phones. Goes out: the mouth opening at the rate of the bundle, and
vertices where they are of the bundle's own mesh. Knows nothing of measures.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np

from facecode.animator import Animator
from facecode.arrays import AnyArray, Float32
from facecode_exporter.bundles.manifest import topology
from facecode_exporter.data.motion_files import SUFFIXES, read_motion
from facecode_exporter.data.recordings import Recording
from facecode_exporter.errors import EvaluationError
from facecode_exporter.measures.lip_sync import opening_curve


class Reference(NamedTuple):
    """What the mouth might have done."""

    opening: Float32
    """(T,) at the rate of the bundle, in any unit"""
    vertices: AnyArray | None
    """(T, V, 3) in the mesh and at the rate of the bundle, where the reference has them"""


ReferenceSource: TypeAlias = "Callable[[Recording, str], Reference | None]"
"""From a recording and the name of a style."""


def from_folder(folder: Path, animator: Animator, lip_pair: tuple[int, int]) -> ReferenceSource:
    """`<name>.npy` or `.npz` of each recording, in the mesh and at the rate of the bundle.

    Raises:
        EvaluationError: no folder; and, when asked, no file or one that does not fit.
    """
    if not folder.is_dir():
        raise EvaluationError(f"{folder} is no folder; expected one of <name>.npz for references")
    manifest, template = animator.manifest, animator.bundle.template

    def reference(recording: Recording, _: str) -> Reference:
        files = [folder / f"{recording.name}{suffix}" for suffix in SUFFIXES]
        path = next((f for f in files if f.is_file()), None)
        if path is None:
            raise EvaluationError(f"{folder} has no {files[0].name} or {files[1].name}")
        vertices = read_motion(path, manifest.n_vertices, manifest.fps)
        return Reference(opening_curve(vertices, lip_pair, template), vertices)

    return reference


def from_rules(animator: Animator) -> ReferenceSource:
    """The corpus's rules, which move a head of their own from phones alone.

    In the style of the same name where the rules know it, else in plain speech, which leads the
    sound by 40 ms. Vertices are comparable where the bundle animates that head.
    """
    from facecode_exporter.corpus.rules import FPS, face_weights
    from facecode_exporter.corpus.styles import STYLES, Style
    from facecode_exporter.head.head import load_head

    head, fps = load_head(), animator.manifest.fps
    same_mesh = fps == FPS and animator.manifest.topology == topology(head.faces)
    styles = {style.name: style for style in STYLES}

    def reference(recording: Recording, style: str) -> Reference:
        rules = styles.get(style, Style("plain"))
        weights = face_weights(recording.audio, recording.phones, rules, seed=0)
        vertices = head.offsets(weights) + head.template
        opening = opening_curve(vertices, head.lip_pair, head.template)
        return Reference(resampled(opening, FPS, fps), vertices if same_mesh else None)

    return reference


def resampled(curve: Float32, fps: float, to_fps: float) -> Float32:
    """A curve at another rate, by linear interpolation; frame 0 stays at 0 s."""
    n_frames = int(len(curve) * to_fps / fps + 1e-6)
    times = np.arange(n_frames) / to_fps
    return np.interp(times, np.arange(len(curve)) / fps, curve).astype(np.float32)
