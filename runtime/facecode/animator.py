"""The recipe: audio -> memory -> codes -> motion. Arithmetic lives in the graphs and helpers.

Equivalence: `exact` decodes the whole prefix at every step and gives the trained system's codes.
`window` decodes the last W frames and equals `exact` for clips of up to W frames.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from facecode.animation import Animation
from facecode.arrays import AnyArray, Audio, Codes, Float32, Offsets, Template, Vectors
from facecode.audio import AudioSource, load_audio, normalise, require_one_frame
from facecode.buffers import GrowingBuffer, KeyValueCache
from facecode.bundle import PACKAGED_BUNDLE, Bundle, load_array
from facecode.codebook import Codebook
from facecode.errors import ManifestError, ModeError
from facecode.session import Graph, default_threads
from facecode.styles import Style, style_weights
from facecode.template import TemplateSource, load_template
from facecode_spec.manifest import Manifest, PartEntry

Mode: TypeAlias = Literal["exact", "window"]
MODES: tuple[Mode, ...] = ("exact", "window")
DEFAULT_WINDOW = 8
"""Frames that `window` decodes when none are given."""
HEAD_CHUNK = 64
"""Frames per call of the vertex head: enough to read its weights rarely, 18 MB for BIWI."""
Memory: TypeAlias = dict[str, AnyArray]
"""What the cross-attention reads, by graph input name, frames on axis 1."""


@dataclass(frozen=True)
class Part:
    """The graphs and the codebook of one part of the face."""

    codebook: Codebook
    decoder_step: Graph
    motion_decoder: Graph
    vertex_head: Graph
    n_layers: int
    dim: int

    @classmethod
    def open(cls, bundle: Bundle, entry: PartEntry, threads: int) -> Part:
        """Load one part of a verified bundle."""

        def axes(name: str) -> tuple[str, ...]:
            return next(t.axes for t in entry.decoder_step.outputs if t.name == name)

        n_layers, _, dim = axes("keys")
        rows = load_array(bundle.root, entry.codebook, (-1, int(axes("features")[-1])), np.float32)
        graphs = (entry.decoder_step, entry.motion_decoder, entry.vertex_head)
        step, motion, head = (Graph(bundle.path(g.path), g, threads) for g in graphs)
        return cls(Codebook(rows), step, motion, head, int(n_layers), int(dim))


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
        if len(self.manifest.parts) != 1:
            raise ManifestError(
                f"the bundle has {len(self.manifest.parts)} parts; this release animates one"
            )
        entry = self.manifest.speech_encoder
        self.speech_encoder = Graph(bundle.path(entry.path), entry, threads)
        self.part = Part.open(bundle, self.manifest.parts[0], threads)

    @property
    def manifest(self) -> Manifest:
        """What the bundle says of itself."""
        return self.bundle.manifest

    @property
    def styles(self) -> tuple[str, ...]:
        """Style names that `animate` takes; the first is the default."""
        return self.manifest.styles

    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        mode: Mode = "exact",
        window: int | None = None,
        template: TemplateSource | None = None,
        sample_rate: int | None = None,
        progress: bool = False,
    ) -> Animation:
        """Animate one clip.

        Args:
            audio: a file, an open binary file, or an array (n,) or (n, n_channels).
            style: a name, or a mix {name: weight}; the bundle's first style by default.
            mode: `exact` gives the trained system's codes; `window` costs the same at every
                frame.
            window: frames that `window` decodes, 1 or more.
            template: another neutral face of the same topology: the name of one of the bundle's
                identities, or .npy, .ply, .obj or (V, 3).
            sample_rate: of an audio array; the bundle's rate by default.
            progress: show a bar on stderr.

        Raises:
            AudioError, AudioNotFoundError, StyleError, TemplateError, ModeError, GraphError.
        """
        n_window = window_frames(mode, window)
        weights = style_weights(style, self.styles)
        neutral = self._neutral(template)
        waveform = load_audio(audio, self.manifest.sample_rate, sample_rate)
        memory = self.encode(waveform)
        codes = np.concatenate(list(self.generate(memory, weights, n_window, progress)), axis=1)
        offsets = self.decode(codes)
        return Animation(
            offsets[0],
            codes[0],
            self.manifest.fps,
            neutral,
            self.bundle.faces,
            self.bundle.colours,
            waveform,
            self.manifest.sample_rate,
        )

    def _neutral(self, template: TemplateSource | None) -> Template:
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
        self,
        memory: Memory,
        weights: Float32,
        window: int | None = None,
        progress: bool = False,
    ) -> Iterator[Codes]:
        """The step loop: codes (1, 1, H) of one frame after the other.

        Args:
            memory: of `encode`.
            weights: style weights (n_styles,).
            window: decode the last `window` frames for the feedback; None: the whole prefix.
            progress: show a bar on stderr.
        """
        part, n_frames = self.part, memory_frames(memory)
        cache = KeyValueCache(part.n_layers, 1, part.dim)
        prefix: GrowingBuffer | None = None
        motion = np.zeros((1, part.dim), dtype=np.float32)
        for step in _steps(n_frames, progress):
            features, keys, values = part.decoder_step.run(
                ("features", "keys", "values"),
                motion=motion,
                style=weights[None],
                step=np.array(step),
                **{name: rows[:, step] for name, rows in memory.items()},
                **cache.inputs(),
            )
            cache.append(keys, values)
            codes = part.codebook.nearest(features)
            vectors = part.codebook.look_up(codes)
            if prefix is None:
                prefix = GrowingBuffer(1, vectors.shape[1:])
            prefix.append(vectors)
            yield codes[:, None]
            if step + 1 < n_frames:
                motion = self.feed_back(prefix.view(window))

    def feed_back(self, vectors: Vectors) -> Float32:
        """Code vectors (B, n, H, C) to the embedding of the last frame's motion (B, D)."""
        last = np.array([vectors.shape[1] - 1])
        return self.part.motion_decoder.run(("feedback",), features=vectors, frames=last)[0]

    def decode(self, codes: Codes) -> Offsets:
        """Codes (B, T, H) of whole clips to offsets (B, T, V, 3)."""
        n_batch, n_frames = codes.shape[:2]
        hidden = self.part.motion_decoder.run(
            ("hidden",),
            features=self.part.codebook.look_up(codes),
            frames=np.arange(n_frames),
        )[0]
        offsets = np.empty((n_batch, n_frames, self.manifest.n_vertices, 3), dtype=np.float32)
        for start in range(0, n_frames, HEAD_CHUNK):
            chunk = slice(start, start + HEAD_CHUNK)
            offsets[:, chunk] = self.part.vertex_head.run(("offsets",), hidden=hidden[:, chunk])[0]
        return offsets


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


def memory_frames(memory: Memory) -> int:
    """T of an encoded clip."""
    n_frames: int = next(iter(memory.values())).shape[1]
    return n_frames


def _steps(n_frames: int, progress: bool) -> Iterable[int]:
    if not progress:
        return range(n_frames)
    from tqdm import tqdm

    return tqdm(range(n_frames), desc="animate", unit="frame")
