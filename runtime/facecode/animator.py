"""The recipe: audio -> memory -> codes -> motion. Arithmetic lives in the graphs and helpers.

Equivalence: `exact` decodes the whole prefix at every step and gives the trained system's codes,
for audio that the speech encoder hears in one pass (see `speech.py`).
`window` decodes W frames at every step and equals `exact` for clips of up to W frames. Samples and
clips on the batch axis give what they give alone.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import overload

import numpy as np

from facecode.animation import Animation
from facecode.arrays import AnyArray, Audio, Codes, Float32, Offsets, Template
from facecode.audio import AudioSource, load_audio
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.compose import compose
from facecode.errors import ModeError
from facecode.loop import GeneratedPart, HeldPart, MotionState, PartLoop, run_loop
from facecode.motion import PrefixMotion
from facecode.part import HEAD_CHUNK, Part
from facecode.request import Held, Mode, Request, window_frames
from facecode.samples import Samples, check_codes, sample_heads
from facecode.session import Graph, default_threads
from facecode.shown import ShownFrames
from facecode.speech import Memory, SpeechEncoder
from facecode.styles import Style, style_weights
from facecode.takes import Takes
from facecode.template import TemplateSource, load_template
from facecode.window import DEFAULT_WINDOW, Show, WindowMotion
from facecode_spec.manifest import Manifest


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
        graph = Graph(bundle.path(entry.path), entry, threads)
        self.speech_encoder = SpeechEncoder(graph, self.manifest)
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
            window: frames that `window` decodes at a step, 3 or more; by default the bundle's
                choice.
            template: another neutral face of the same topology: the name of one of the bundle's
                identities, or .npy, .ply, .obj or (V, 3).
            sample_rate: of an audio array; the bundle's rate by default.
            samples: how many faces, each a sample of every part; or how many samples by part
                name, each combined with each of the part before. The same number gives the same
                faces, and fewer give the first of them.
            hold: parts to keep as they are: codes (T, H), or a clip, by part name.
            progress: show a bar on stderr.

        Raises:
            AudioError, AudioNotFoundError, StyleError, TemplateError, ModeError, SampleError,
            CodesError, GraphError.
        """
        request = Request(self.window_frames(mode, window), samples, hold or {}, progress)
        sample_heads(samples, self.parts, request.hold)
        weights = style_weights(style, self.styles)
        neutral = self.neutral(template)
        waveform = load_audio(audio, self.manifest.sample_rate, sample_rate)
        ((codes, offsets),) = self.move([self.encode(waveform)], weights[None], request)
        clips = [
            self.animation(o, c, waveform, neutral) for o, c in zip(offsets, codes, strict=True)
        ]
        return clips[0] if samples is None else Takes(tuple(clips))

    def window_frames(self, mode: str, window: int | None) -> int | None:
        """As the function of that name, the bundle's choice by default."""
        stated = self.manifest.window
        return window_frames(mode, window, DEFAULT_WINDOW if stated is None else stated.frames)

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
        return self.speech_encoder.encode(waveform)

    def generate(
        self,
        memories: Sequence[Memory],
        weights: Float32,
        request: Request,
        shows: Sequence[Show] = (),
    ) -> Iterable[list[Codes]]:
        """The step loop: for every frame the codes (n_clips, rows, H) of each part.

        Args:
            memories: of `encode`, of clips of falling length.
            weights: style weights (n_clips, n_styles).
            request: window, samples and held codes.
            shows: for each part, what takes its hidden frames in `window` mode.

        Raises:
            SampleError, CodesError.
        """
        lengths = [memory.n_frames for memory in memories]
        heads = sample_heads(request.samples, self.parts, request.hold)
        held = {name: self._held(name, clip, lengths) for name, clip in request.hold.items()}
        loops: list[PartLoop] = [
            HeldPart(held[part.name])
            if part.name in held
            else self._generated(part, memories, weights, heads[part.name], request.window, show)
            for part, show in zip(self.parts, shows or (_ignore,) * len(self.parts), strict=True)
        ]
        frames = run_loop(self.parts, loops, lengths)
        return _with_bar(frames, lengths[0]) if request.progress else frames

    def _generated(
        self,
        part: Part,
        memories: Sequence[Memory],
        weights: Float32,
        samples: AnyArray,
        window: int | None,
        show: Show,
    ) -> GeneratedPart:
        n_rows = len(weights) * len(samples)
        shape = (part.codes_per_frame, part.codebook.rows.shape[1])
        motion: MotionState = (
            PrefixMotion(part.motion, n_rows, shape)
            if window is None
            else WindowMotion(part.motion, n_rows, shape, window, show)
        )
        return GeneratedPart(part, memories, weights, samples, motion)

    def move(
        self, memories: Sequence[Memory], weights: Float32, request: Request
    ) -> list[tuple[Codes, Offsets]]:
        """Codes (K, T, H) and offsets (K, T, V, 3) of each clip, K faces a clip; see `generate`."""
        shows = [ShownFrames() for _ in self.parts]
        frames = list(self.generate(memories, weights, request, shows))
        moved = []
        for i, memory in enumerate(memories):
            reached = frames[: memory.n_frames]
            clip = [
                np.stack([frame[p][i] for frame in reached], axis=1) for p in range(len(self.parts))
            ]
            hidden = [show.of_clip(i, codes) for show, codes in zip(shows, clip, strict=True)]
            moved.append(self._compose(clip, hidden))
        return moved

    def blocks(
        self, memory: Memory, weights: Float32, window: int
    ) -> Iterator[tuple[Codes, Offsets]]:
        """One clip in `window` mode, codes (n, H) and offsets (n, V, 3) as they become final.

        Blocks follow each other; nothing of those given is kept, so that a clip may have any
        length.
        """
        shows = [ShownFrames() for _ in self.parts]
        waiting: deque[list[Codes]] = deque()
        for frame in self.generate([memory], weights[None], Request(window), shows):
            waiting.append(frame)
            if len(shows[0]) >= HEAD_CHUNK:
                yield self._block(shows, waiting)
        while waiting:
            yield self._block(shows, waiting)

    def _block(
        self, shows: Sequence[ShownFrames], waiting: deque[list[Codes]]
    ) -> tuple[Codes, Offsets]:
        hidden = [show.take(0, 1) for show in shows]
        frames = [waiting.popleft() for _ in range(hidden[0].shape[1])]
        clip = [np.stack([frame[p][0] for frame in frames], axis=1) for p in range(len(shows))]
        codes, offsets = self._compose(clip, hidden)
        return codes[0], offsets[0]

    def decode(self, codes: Codes) -> Offsets:
        """Codes (T, H) of a clip, or (B, T, H) of several, to offsets (T, V, 3) or (B, T, V, 3).

        Raises:
            CodesError: another H, or codes outside the codebook.
        """
        edges = np.cumsum([part.codes_per_frame for part in self.parts])
        columns = np.split(np.asarray(codes), edges[:-1], axis=-1)
        apart = [check_codes(c, part) for c, part in zip(columns, self.parts, strict=True)]
        if apart[0].ndim == 2:
            _, (offsets,) = self._compose([c[None] for c in apart], [None] * len(apart))
            return np.asarray(offsets)
        return self._compose(apart, [None] * len(apart))[1]

    def _held(self, name: str, kept: AnyArray | Animation, lengths: Sequence[int]) -> Codes:
        """(1, T, H) codes of a part, for the one clip that there is."""
        part = {p.name: p for p in self.parts}.get(name)
        if part is None or len(lengths) != 1:
            names = ", ".join(p.name for p in self.parts)
            raise ModeError(f"got {name!r} to hold; expected one of {names}, and one recording")
        codes = kept.codes_of(name) if isinstance(kept, Animation) else kept
        return check_codes(codes, part, lengths[0])[None]

    def _compose(
        self, clip: Sequence[Codes], hidden: Sequence[Float32 | None]
    ) -> tuple[Codes, Offsets]:
        return compose(self.parts, self.manifest.n_vertices, clip, hidden)


def load(path: str | os.PathLike[str] | None = None, *, threads: int | None = None) -> Animator:
    """Open and verify the bundle at `path` (default: the packaged one) and load its graphs.

    Raises:
        BundleError: see `facecode.errors`.
    """
    return Animator(Bundle.open(PACKAGED_BUNDLE if path is None else path), threads)


def _ignore(rows: slice, hidden: Float32) -> None:
    """Frames that nobody looks at."""


def _with_bar(frames: Iterator[list[Codes]], n_frames: int) -> Iterable[list[Codes]]:
    from tqdm import tqdm

    return tqdm(frames, total=n_frames, desc="animate", unit="frame")
