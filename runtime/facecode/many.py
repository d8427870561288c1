"""Many recordings at once: every read of the weights serves all clips of a batch."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

from facecode.animation import Animation
from facecode.animator import LONGEST_EXACT_S, Animator
from facecode.arrays import Audio, Template
from facecode.audio import AudioSource, load_audio
from facecode.errors import FacecodeError
from facecode.live.clip import refuse_in_live
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
        **options: see `facecode.options.BatchOptions`.

    Yields:
        For each source, in order, its animation, or the error that it met: one bad file does not
        stop the others.

    Raises:
        StyleError, TemplateError, ModeError: before the first clip.
        ValueError: a batch size below 1.
    """
    refuse_unknown("animate_many", options, BatchOptions)
    refuse_in_live(options)
    if batch_size < 1:
        raise ValueError(f"got batches of {batch_size} clips; expected at least 1")
    face = load() if face is None else face
    request, neutral = face.request(style, options), face.bundle.neutral(options.get("template"))
    if options.get("mode") == "live":
        return _one_by_one(face, sources, style, options)
    encoded = (_encode(face, source, options.get("sample_rate")) for source in sources)
    return _batches(encoded, _Batch(face, request, options, neutral), batch_size)


def _one_by_one(
    face: Animator, sources: Iterable[AudioSource], style: Style | None, options: BatchOptions
) -> Iterator[Animation | FacecodeError]:
    """A stream each: what it encodes is not the whole speech."""
    for source in sources:
        try:
            yield face.animate(source, style, **options)
        except FacecodeError as error:
            yield error


def _batches(
    encoded: Iterator[Encoded], batch: _Batch, batch_size: int
) -> Iterator[Animation | FacecodeError]:
    while clips := list(itertools.islice(encoded, batch_size)):
        yield from batch.animate(clips)


def _encode(face: Animator, source: AudioSource, sample_rate: int | None) -> Encoded:
    try:
        waveform = load_audio(source, face.manifest.sample_rate, sample_rate)
        return waveform, face.engine.encode(waveform)
    except FacecodeError as error:
        return error


@dataclass(frozen=True)
class _Batch:
    """What the clips of a batch have in common."""

    face: Animator
    request: Request
    options: BatchOptions
    neutral: Template

    def animate(self, batch: Sequence[Encoded]) -> list[Animation | FacecodeError]:
        """The clips of a batch, those of one mode together, or their errors."""
        results: list[Animation | FacecodeError | None] = [
            item if isinstance(item, FacecodeError) else None for item in batch
        ]
        clips = [(i, *item) for i, item in enumerate(batch) if not isinstance(item, FacecodeError)]
        clips.sort(key=lambda clip: -clip[2].n_frames)  # as the loop takes them
        longer = self.face.for_long_speech(self.request, self.options)
        longest = LONGEST_EXACT_S * self.face.manifest.sample_rate
        requests = [longer if len(c[1]) > longest else self.request for c in clips]
        for _, same in itertools.groupby(
            zip(clips, requests, strict=True), key=lambda pair: pair[1].window
        ):
            pairs = list(same)
            memories, request = [memory for (_, _, memory), _ in pairs], pairs[0][1]
            motions = self.face.engine.move(memories, request)
            for ((i, waveform, _), _), (codes, motion) in zip(pairs, motions, strict=True):
                clip = self.face.result(request, self.neutral, waveform, codes[0], motion[0])
                results[i] = clip
        return [result for result in results if result is not None]
