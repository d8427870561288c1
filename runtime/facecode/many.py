"""Many recordings at once: every read of the weights serves all clips of a batch."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, TypeAlias

from facecode.animation import Animation
from facecode.animator import Animator
from facecode.arrays import Audio, Template
from facecode.audio import AudioSource, load_audio
from facecode.errors import FacecodeError
from facecode.loading import load
from facecode.loop.request import Request, refuse_unknown
from facecode.options import BatchOptions, Style
from facecode.speech import Memory

if TYPE_CHECKING:
    from typing_extensions import Unpack

BATCH_SIZE = 8
"""Clips at once: beyond it the arithmetic, not the reading of weights, takes the time."""

Encoded: TypeAlias = "tuple[Audio, Memory] | FacecodeError"
"""A waveform with its memory, or why there is none."""


def animate_many(
    sources: Iterable[AudioSource],
    style: Style | None = None,
    *,
    face: Animator | None = None,
    batch_size: int = BATCH_SIZE,
    **options: Unpack[BatchOptions],
) -> Iterator[Animation | FacecodeError]:
    """Animate recordings in batches; each gives the codes that it gives alone.

    Args:
        sources: as `audio` of `Animator.animate`, one a clip; lengths may differ, but a batch of
            clips of about one length is quickest.
        style: for all; see `Animator.animate`.
        face: a loaded bundle; the packaged one by default.
        batch_size: clips at once; memory grows with it.
        **options: `mode`, `window`, `template`, `sample_rate`; see
            `facecode.options.BatchOptions`.

    Yields:
        For each source, in order, its animation, or the error that it met: one bad file does not
        stop the others.

    Raises:
        StyleError, TemplateError, ModeError: before the first clip.
        ValueError: a batch size below 1.
    """
    refuse_unknown("animate_many", options, BatchOptions)
    if batch_size < 1:
        raise ValueError(f"got batches of {batch_size} clips; expected at least 1")
    face = load() if face is None else face
    request, neutral = face.request(style, options), face.bundle.neutral(options.get("template"))
    encoded = (_encode(face, source, options.get("sample_rate")) for source in sources)
    return _batches(face, encoded, request, neutral, batch_size)


def _batches(
    face: Animator,
    encoded: Iterator[Encoded],
    request: Request,
    neutral: Template,
    batch_size: int,
) -> Iterator[Animation | FacecodeError]:
    while batch := list(itertools.islice(encoded, batch_size)):
        yield from _animate(face, batch, request, neutral)


def _encode(face: Animator, source: AudioSource, sample_rate: int | None) -> Encoded:
    try:
        waveform = load_audio(source, face.manifest.sample_rate, sample_rate)
        return waveform, face.engine.encode(waveform)
    except FacecodeError as error:
        return error


def _animate(
    face: Animator, batch: Sequence[Encoded], request: Request, neutral: Template
) -> list[Animation | FacecodeError]:
    """One batch: the loop takes its clips in order of falling length."""
    results: list[Animation | FacecodeError | None] = [
        item if isinstance(item, FacecodeError) else None for item in batch
    ]
    clips = [(i, *item) for i, item in enumerate(batch) if not isinstance(item, FacecodeError)]
    clips.sort(key=lambda clip: -clip[2].n_frames)
    if clips:
        motions = face.engine.move([memory for _, _, memory in clips], request)
        for (i, waveform, _), (codes, offsets) in zip(clips, motions, strict=True):
            results[i] = face.result(request, neutral, waveform, codes[0], offsets[0])
    return [result for result in results if result is not None]
