"""Many recordings at once: every read of the weights serves all clips of a batch."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from facecode.animation import Animation
from facecode.animator import Animator, load
from facecode.arrays import Audio, Float32, Template
from facecode.audio import AudioSource, load_audio
from facecode.errors import FacecodeError
from facecode.request import Mode, Request
from facecode.speech import Memory
from facecode.styles import Style, style_weights
from facecode.template import TemplateSource

BATCH_SIZE = 8
"""Clips at once: beyond it the arithmetic, not the reading of weights, takes the time."""


def animate_many(
    sources: Iterable[AudioSource],
    style: Style | None = None,
    *,
    face: Animator | None = None,
    mode: Mode = "exact",
    window: int | None = None,
    template: TemplateSource | None = None,
    sample_rate: int | None = None,
    batch_size: int = BATCH_SIZE,
) -> Iterator[Animation | FacecodeError]:
    """Animate recordings in batches; each gives the codes that it gives alone.

    Args:
        sources: as `audio` of `Animator.animate`, one a clip; lengths may differ, but a batch of
            clips of about one length is quickest.
        style: for all; see `Animator.animate`, also for the other arguments.
        face: a loaded bundle; the packaged one by default.
        mode: `exact` or `window`.
        window: frames that `window` decodes.
        template: another neutral face.
        sample_rate: of audio arrays.
        batch_size: clips at once; memory grows with it.

    Yields:
        For each source, in order, its animation, or the error that it met: one bad file does not
        stop the others.

    Raises:
        StyleError, TemplateError, ModeError: before the first clip.
        ValueError: a batch size below 1.
    """
    if batch_size < 1:
        raise ValueError(f"got batches of {batch_size} clips; expected at least 1")
    face = load() if face is None else face
    request = Request(face.window_frames(mode, window))
    weights = style_weights(style, face.styles)
    neutral = face.neutral(template)
    return _batches(face, sources, weights, request, neutral, sample_rate, batch_size)


def _batches(
    face: Animator,
    sources: Iterable[AudioSource],
    weights: Float32,
    request: Request,
    neutral: Template,
    sample_rate: int | None,
    batch_size: int,
) -> Iterator[Animation | FacecodeError]:
    heard: list[tuple[Audio, Memory] | FacecodeError] = []
    for source in sources:
        heard.append(_heard(face, source, sample_rate))
        if len(heard) == batch_size:
            yield from _moved(face, heard, weights, request, neutral)
            heard = []
    yield from _moved(face, heard, weights, request, neutral)


def _heard(
    face: Animator, source: AudioSource, sample_rate: int | None
) -> tuple[Audio, Memory] | FacecodeError:
    try:
        waveform = load_audio(source, face.manifest.sample_rate, sample_rate)
        return waveform, face.encode(waveform)
    except FacecodeError as error:
        return error


def _moved(
    face: Animator,
    heard: Sequence[tuple[Audio, Memory] | FacecodeError],
    weights: Float32,
    request: Request,
    neutral: Template,
) -> list[Animation | FacecodeError]:
    """One batch: the loop takes its clips in order of falling length."""
    results: list[Animation | FacecodeError | None] = [
        h if isinstance(h, FacecodeError) else None for h in heard
    ]
    clips = [(i, *h) for i, h in enumerate(heard) if not isinstance(h, FacecodeError)]
    clips.sort(key=lambda clip: -clip[2].n_frames)
    if clips:
        styles = np.repeat(weights[None], len(clips), axis=0)
        moved = face.move([memory for _, _, memory in clips], styles, request)
        for (i, waveform, _), (codes, offsets) in zip(clips, moved, strict=True):
            results[i] = face.animation(offsets[0], codes[0], waveform, neutral)
    return [r for r in results if r is not None]
