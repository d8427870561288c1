"""Encode speech to what the cross-attention reads, frame by frame; long clips window by window.

Attention over an hour does not fit. Up to LONGEST_S a clip is encoded in one pass, as it was in
training. A longer one is encoded in windows that overlap: KEPT_S of each are kept, CONTEXT_S on
either side are encoded and dropped. One window is held at a time, so that memory does not grow
with the clip. The waveform is normalised over the whole clip in either case.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from facecode.arrays import AnyArray, Audio
from facecode.errors import AudioTooShortError
from facecode.level import Level
from facecode.session import Graph
from facecode_spec.manifest import Manifest

KEPT_S, CONTEXT_S = 20, 5
LONGEST_S = KEPT_S + 2 * CONTEXT_S


class Memory(Protocol):
    """An encoded clip of `n_frames` frames."""

    @property
    def n_frames(self) -> int:
        """T."""

    def frame(self, step: int) -> Mapping[str, AnyArray]:
        """What frame `step` reads, (1, ...) by graph input name; steps come in rising order."""


@dataclass(frozen=True)
class WholeMemory:
    """A clip encoded in one pass: (1, T, ...) by graph input name."""

    rows: Mapping[str, AnyArray]

    @property
    def n_frames(self) -> int:
        """T."""
        n_frames: int = next(iter(self.rows.values())).shape[1]
        return n_frames

    def frame(self, step: int) -> Mapping[str, AnyArray]:
        """See `Memory`."""
        return {name: rows[:, step] for name, rows in self.rows.items()}


class SpeechEncoder:
    """The graph `speech_encoder` with what the manifest says of audio."""

    def __init__(self, graph: Graph, manifest: Manifest) -> None:
        self.graph, self._manifest = graph, manifest

    def with_graph(self, graph: Graph) -> SpeechEncoder:
        """The same encoder with another graph of the same signature."""
        return SpeechEncoder(graph, self._manifest)

    def encode(self, waveform: Audio) -> Memory:
        """Waveform (n_samples,) at the bundle's rate to its memory.

        Raises:
            AudioTooShortError
        """
        rate = self._manifest.sample_rate
        require_one_frame(waveform, rate, self._manifest.min_samples)
        level = Level.of(waveform) if self._manifest.normalise_audio else None
        clip = LevelledAudio(waveform, level, rate)
        if len(waveform) <= LONGEST_S * rate:
            return self.window(clip, 0, len(waveform))
        return LongMemory(self, clip, self._manifest.fps)

    def window(self, clip: LevelledAudio, start: int, stop: int) -> WholeMemory:
        """Samples `start` to `stop` in one pass."""
        return self.memory(clip.waveform[start:stop], clip.level)

    def memory(self, waveform: Audio, level: Level | None) -> WholeMemory:
        """A piece of a waveform in one pass, normalised by `level`; None: as it is."""
        piece = waveform if level is None else level.apply(waveform)
        names = [t.name for t in self._manifest.speech_encoder.outputs]
        outputs = self.graph.run(names, audio=piece[None])
        return WholeMemory(dict(zip(names, outputs, strict=True)))

    @property
    def normalises(self) -> bool:
        """Whether the waveform is normalised by its level."""
        return self._manifest.normalise_audio

    @property
    def min_samples(self) -> int:
        """Samples that give one frame."""
        return self._manifest.min_samples


@dataclass(frozen=True)
class LevelledAudio:
    """A waveform, and the level that normalises it piece by piece; None: as it is."""

    waveform: Audio
    level: Level | None
    rate: int


def require_one_frame(audio: Audio, rate: int, min_samples: int) -> None:
    """Refuse audio that is too short for a single frame.

    Raises:
        AudioTooShortError
    """
    if len(audio) < min_samples:
        raise AudioTooShortError(
            f"the audio is {1000 * len(audio) / rate:.1f} ms long; one frame needs "
            f"{1000 * min_samples / rate:.1f} ms ({min_samples} samples at {rate} Hz)"
        )


class LongMemory:
    """A clip encoded window by window, each when its first frame is asked for.

    Windows begin at whole seconds, where a frame begins too.
    """

    def __init__(self, encoder: SpeechEncoder, clip: LevelledAudio, fps: float) -> None:
        self._encoder, self._clip, self._fps = encoder, clip, fps
        self._n_samples = len(clip.waveform)
        # Only the encoder knows its number of frames: ask it about the last second or two.
        last_s = self._n_samples // clip.rate - 1
        tail = encoder.window(clip, last_s * clip.rate, self._n_samples)
        self._n_frames = self._frame_at(last_s) + tail.n_frames
        self._first = self._end = 0
        self._window = tail

    @property
    def n_frames(self) -> int:
        """See `Memory`."""
        return self._n_frames

    def _frame_at(self, second: int) -> int:
        return round(second * self._fps)

    def frame(self, step: int) -> Mapping[str, AnyArray]:
        """See `Memory`."""
        if step >= self._end:
            self._encode(step)
        return self._window.frame(step - self._first)

    def _encode(self, step: int) -> None:
        """The window whose kept part begins at or before frame `step`."""
        kept_s = math.floor(step / self._fps) // KEPT_S * KEPT_S
        rate = self._clip.rate
        from_s = max(0, kept_s - CONTEXT_S)
        stop = min((kept_s + KEPT_S + CONTEXT_S) * rate, self._n_samples)
        self._window = self._encoder.window(self._clip, from_s * rate, stop)
        self._first = self._frame_at(from_s)
        at_end = stop == self._n_samples
        self._end = self._n_frames if at_end else self._frame_at(kept_s + KEPT_S)


def frames_of(memories: Sequence[Memory], step: int) -> dict[str, AnyArray]:
    """What frame `step` of several clips reads, (n_clips, ...) by graph input name."""
    frames = [memory.frame(step) for memory in memories]
    if len(frames) == 1:
        return dict(frames[0])
    return {name: np.concatenate([f[name] for f in frames]) for name in frames[0]}
