"""The recipe: audio -> memory -> codes -> motion. Arithmetic lives in the graphs and helpers.

Equivalence: `exact` decodes the whole prefix at every step and gives the trained system's codes.
`window` decodes the last W frames and equals `exact` for clips of up to W frames. Samples and
clips on the batch axis give what they give alone.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias, overload

import numpy as np

from facecode.animation import Animation
from facecode.arrays import AnyArray, Audio, Codes, Float32, Offsets, Template
from facecode.audio import AudioSource, load_audio, normalise, require_one_frame
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.errors import ModeError
from facecode.loop import GeneratedPart, HeldPart, Memory, PartLoop, memory_frames, run_loop
from facecode.part import Part
from facecode.samples import Samples, check_codes, head_numbers, sample_counts
from facecode.session import Graph, default_threads
from facecode.styles import Style, style_weights
from facecode.takes import Takes
from facecode.template import TemplateSource, load_template
from facecode_spec.manifest import Manifest

Mode: TypeAlias = Literal["exact", "window"]
MODES: tuple[Mode, ...] = ("exact", "window")
DEFAULT_WINDOW = 8
"""Frames that `window` decodes when none are given."""
Held: TypeAlias = "Mapping[str, AnyArray | Animation]"
"""Codes (T, H) to keep, or a clip whose codes to keep, by part name."""


@dataclass(frozen=True)
class Request:
    """What to generate beside the speech."""

    window: int | None = None
    """Decode the last `window` frames for the feedback; None: the whole prefix."""
    samples: Samples | None = None
    hold: Held = field(default_factory=dict)
    progress: bool = False


class Animator:
    """A loaded bundle, ready to animate any number of clips; it keeps no state between them."""

    def __init__(self, bundle: Bundle, threads: int | None = None) -> None:
        """Load the graphs of `bundle` for `threads` threads (default: all usable cores).

        Raises:
            GraphError, ManifestError, ValueError: fewer than one thread.
        """
        threads = default_threads() if threads is None else threads
        if threads < 1:
            raise ValueError(f"got {threads} threads; expected at least 1")
        self.bundle, self.threads = bundle, threads
        entry = self.manifest.speech_encoder
        self.speech_encoder = Graph(bundle.path(entry.path), entry, threads)
        self.parts = tuple(Part.open(bundle, part, threads) for part in self.manifest.parts)

    @property
    def manifest(self) -> Manifest:
        """What the bundle says of itself."""
        return self.bundle.manifest

    @property
    def styles(self) -> tuple[str, ...]:
        """Style names that `animate` takes; the first is the default."""
        return self.manifest.styles

    @overload
    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        mode: Mode = "exact",
        window: int | None = None,
        template: TemplateSource | None = None,
        sample_rate: int | None = None,
        samples: None = None,
        hold: Held | None = None,
        progress: bool = False,
    ) -> Animation: ...

    @overload
    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        mode: Mode = "exact",
        window: int | None = None,
        template: TemplateSource | None = None,
        sample_rate: int | None = None,
        samples: Samples,
        hold: Held | None = None,
        progress: bool = False,
    ) -> Takes: ...

    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        mode: Mode = "exact",
        window: int | None = None,
        template: TemplateSource | None = None,
        sample_rate: int | None = None,
        samples: Samples | None = None,
        hold: Held | None = None,
        progress: bool = False,
    ) -> Animation | Takes:
        """Animate one clip; with `samples`, several times.

        Args:
            audio: a file, an open binary file, or an array (n,) or (n, n_channels).
            style: a name, or a mix {name: weight}; the bundle's first style by default.
            mode: `exact` gives the trained system's codes; `window` costs the same at every
                frame.
            window: frames that `window` decodes, 1 or more.
            template: another neutral face of the same topology: the name of one of the bundle's
                identities, or .npy, .ply, .obj or (V, 3).
            sample_rate: of an audio array; the bundle's rate by default.
            samples: how many faces, for the first part that has several, or by part name; each
                sample of a part is combined with each of the part before. The same number gives
                the same faces, and fewer give the first of them.
            hold: parts to keep as they are: codes (T, H), or a clip, by part name.
            progress: show a bar on stderr.

        Raises:
            AudioError, AudioNotFoundError, StyleError, TemplateError, ModeError, SampleError,
            CodesError, GraphError.
        """
        request = Request(window_frames(mode, window), samples, hold or {}, progress)
        sample_counts(samples, self.parts)
        weights = style_weights(style, self.styles)
        neutral = self.neutral(template)
        waveform = load_audio(audio, self.manifest.sample_rate, sample_rate)
        ((codes, offsets),) = self.move([self.encode(waveform)], weights[None], request)
        clips = [
            self.animation(o, c, waveform, neutral) for o, c in zip(offsets, codes, strict=True)
        ]
        return clips[0] if samples is None else Takes(tuple(clips))

    def animation(
        self, offsets: Offsets, codes: Codes, waveform: Audio, neutral: Template
    ) -> Animation:
        """Offsets (T, V, 3) and codes (T, H) of a clip, with what the bundle knows of the face."""
        return Animation(
            offsets,
            codes,
            self.manifest.fps,
            neutral,
            self.bundle.faces,
            self.bundle.colours,
            waveform,
            self.manifest.sample_rate,
            {part.name: part.codes_per_frame for part in self.parts},
        )

    def neutral(self, template: TemplateSource | None) -> Template:
        """The neutral face (V, 3) that `template` names; the bundle's for None.

        Raises:
            TemplateError
        """
        if template is None:
            return self.bundle.template
        if isinstance(template, str) and template in self.manifest.identities:
            return self.bundle.identity(template)
        return load_template(template, self.manifest.n_vertices)

    def encode(self, waveform: Audio) -> Memory:
        """Waveform (n_samples,) at the bundle's rate to the memory of its T frames.

        Raises:
            AudioTooShortError
        """
        require_one_frame(waveform, self.manifest.sample_rate, self.manifest.min_samples)
        if self.manifest.normalise_audio:
            waveform = normalise(waveform)
        names = [t.name for t in self.manifest.speech_encoder.outputs]
        outputs = self.speech_encoder.run(names, audio=waveform[None])
        return dict(zip(names, outputs, strict=True))

    def generate(
        self, memories: Sequence[Memory], weights: Float32, request: Request
    ) -> Iterable[list[Codes]]:
        """The step loop: for every frame the codes (n_clips, rows, H) of each part.

        Args:
            memories: of `encode`, of clips of falling length.
            weights: style weights (n_clips, n_styles).
            request: window, samples and held codes.

        Raises:
            SampleError, CodesError.
        """
        lengths = [memory_frames(memory) for memory in memories]
        together = _together(memories)
        counts = sample_counts(request.samples, self.parts)
        held = {name: self._held(name, clip, lengths) for name, clip in request.hold.items()}
        heads = head_numbers({name: 1 if name in held else n for name, n in counts.items()})
        loops: list[PartLoop] = [
            HeldPart(held[part.name])
            if part.name in held
            else GeneratedPart(part, together, weights, heads[part.name], request.window)
            for part in self.parts
        ]
        frames = run_loop(self.parts, loops, lengths)
        return _with_bar(frames, lengths[0]) if request.progress else frames

    def move(
        self, memories: Sequence[Memory], weights: Float32, request: Request
    ) -> list[tuple[Codes, Offsets]]:
        """Codes (K, T, H) and offsets (K, T, V, 3) of each clip, K faces a clip; see `generate`."""
        frames = list(self.generate(memories, weights, request))
        moved = []
        for i, memory in enumerate(memories):
            reached = frames[: memory_frames(memory)]
            clip = [
                np.stack([frame[p][i] for frame in reached], axis=1) for p in range(len(self.parts))
            ]
            moved.append(self._compose(clip))
        return moved

    def decode(self, codes: Codes) -> Offsets:
        """Codes (T, H) of a clip, or (B, T, H) of several, to offsets (T, V, 3) or (B, T, V, 3).

        Raises:
            CodesError: another H, or codes outside the codebook.
        """
        edges = np.cumsum([part.codes_per_frame for part in self.parts])
        columns = np.split(np.asarray(codes), edges[:-1], axis=-1)
        apart = [check_codes(c, part) for c, part in zip(columns, self.parts, strict=True)]
        if apart[0].ndim == 2:
            _, (offsets,) = self._compose([c[None] for c in apart])
            return np.asarray(offsets)
        return self._compose(apart)[1]

    def _held(self, name: str, kept: AnyArray | Animation, lengths: Sequence[int]) -> Codes:
        """(1, T, H) codes of a part, for the one clip that there is."""
        part = {p.name: p for p in self.parts}.get(name)
        if part is None or len(lengths) != 1:
            names = ", ".join(p.name for p in self.parts)
            raise ModeError(f"got {name!r} to hold; expected one of {names}, and one recording")
        codes = kept.codes_of(name) if isinstance(kept, Animation) else kept
        return check_codes(codes, part, lengths[0])[None]

    def _compose(self, clip: Sequence[Codes]) -> tuple[Codes, Offsets]:
        """Rows of each part's codes (rows, T, H) to codes and offsets of all faces."""
        n_faces = max(len(codes) for codes in clip)
        n_frames = clip[0].shape[1]
        offsets = np.empty((n_faces, n_frames, self.manifest.n_vertices, 3), dtype=np.float32)
        every = []
        for part, codes in zip(self.parts, clip, strict=True):
            share = n_faces // len(codes)
            part.decode(codes, offsets[::share])
            for k in range(1, share):
                _copy(offsets[::share], offsets[k::share], part)
            every.append(np.repeat(codes, share, axis=0))
        return np.concatenate(every, axis=2), offsets


def load(path: str | os.PathLike[str] | None = None, *, threads: int | None = None) -> Animator:
    """Open and verify the bundle at `path` (default: the packaged one) and load its graphs.

    Raises:
        BundleError: see `facecode.errors`.
    """
    return Animator(Bundle.open(PACKAGED_BUNDLE if path is None else path), threads)


def window_frames(mode: str, window: int | None) -> int | None:
    """Frames to decode per step: None for the whole prefix.

    Raises:
        ModeError: unknown mode, `window` without window mode, or not positive.
    """
    if mode not in MODES:
        raise ModeError(f"got mode {mode!r}; expected one of {', '.join(MODES)}")
    if mode == "exact":
        if window is not None:
            raise ModeError("a window goes with mode 'window'; exact decodes the whole prefix")
        return None
    if window is not None and window < 1:
        raise ModeError(f"got a window of {window} frames; expected at least 1")
    return DEFAULT_WINDOW if window is None else window


def _together(memories: Sequence[Memory]) -> Memory:
    """Memories of clips of falling length as one, zeros after the end of each."""
    if len(memories) == 1:
        return memories[0]
    together = {}
    for name, longest in memories[0].items():
        rows = np.zeros((len(memories), *longest.shape[1:]), longest.dtype)
        for row, memory in zip(rows, memories, strict=True):
            row[: memory[name].shape[1]] = memory[name][0]
        together[name] = rows
    return together


def _copy(source: Offsets, target: Offsets, part: Part) -> None:
    """The part's vertices of `source` into `target`, face by face."""
    if part.vertices is None:
        target[...] = source
    else:
        target[:, :, part.vertices] = source[:, :, part.vertices]


def _with_bar(frames: Iterator[list[Codes]], n_frames: int) -> Iterable[list[Codes]]:
    from tqdm import tqdm

    return tqdm(frames, total=n_frames, desc="animate", unit="frame")
