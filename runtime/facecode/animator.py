"""The door of the runtime: a loaded bundle that animates recordings.

Equivalence: `exact` decodes the whole prefix at every step and gives the trained system's codes,
for audio that is encoded in one pass (see `speech.py`). `window` decodes W frames at every step
and equals `exact` for clips of up to W frames. Samples and clips on the batch axis give what they
give alone.
"""

from __future__ import annotations

import dataclasses
from functools import cached_property
from typing import TYPE_CHECKING, overload

import numpy as np

from facecode.animation import Animation
from facecode.arrays import AnyArray, Audio, Codes, Offsets, Template
from facecode.audio import AudioSource, load_audio
from facecode.blocks import Blocks
from facecode.bundle import Bundle
from facecode.live.clip import live_clip, refuse_in_live
from facecode.live.decoding import live_window
from facecode.live.stream import Stream
from facecode.live.voice import Voices
from facecode.loop.engine import Engine
from facecode.loop.request import Request, Window, refuse_unknown, style_weights, window_of
from facecode.options import BatchOptions, Held, Options, Samples, Style
from facecode.session import Compute
from facecode.takes import Takes
from facecode.weights import WeightProblem
from facecode_spec.manifest import Manifest

if TYPE_CHECKING:
    from typing_extensions import Unpack


LONGEST_EXACT_S = 15.0
"""Speech up to which `auto` is `exact`."""


class Animator:
    """A loaded bundle, ready to animate any number of clips; it keeps no state between them."""

    def __init__(self, bundle: Bundle, compute: Compute | None = None) -> None:
        """Load the graphs of `bundle`; GraphError, ManifestError or ProviderError if they fail."""
        self.bundle, self.compute = bundle, Compute() if compute is None else compute
        self.engine = Engine.open(bundle, self.compute)
        self._still = Animation.still(bundle)

    @property
    def manifest(self) -> Manifest:
        """What the bundle says of itself."""
        return self.bundle.manifest

    @property
    def styles(self) -> tuple[str, ...]:
        """Style names; the first is the default."""
        return self.manifest.styles

    @property
    def gives_weights(self) -> bool:
        """Whether the bundle has face units, for `animate(..., vertices=False)`."""
        return all(part.rig_projection is not None for part in self.engine.parts)

    @overload
    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        samples: None = None,
        **options: Unpack[Options],
    ) -> Animation: ...

    @overload
    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        samples: Samples,
        **options: Unpack[Options],
    ) -> Takes: ...

    def animate(
        self,
        audio: AudioSource,
        style: Style | None = None,
        *,
        samples: Samples | None = None,
        **options: Unpack[Options],
    ) -> Animation | Takes:
        """Animate one recording; with `samples`, several times.

        Args:
            audio: a file, an open binary file, or an array (n,) or (n, n_channels).
            style: a name, or a mix {name: weight}; the bundle's first style by default.
            samples: how many faces, each a sample of every part; or how many samples by part
                name, each combined with each of the part before. The same number gives the same
                faces, and fewer give the first of them.
            **options: see `facecode.options.Options`.

        Raises:
            AudioError, AudioNotFoundError, StyleError, TemplateError, ModeError, SampleError,
            CodesError, NoRigError, GraphError.
        """
        refuse_unknown("animate", options, Options)
        request, neutral, waveform = self._asked(audio, style, options, samples)
        if options.get("mode") == "live":
            still = self.result(request, neutral, waveform, self._still.codes, self._still.offsets)
            return self._live(still, request, options)
        codes, motion = self.engine.animate(waveform, request)
        faces = zip(codes, motion, strict=True)
        clips = [self.result(request, neutral, waveform, *face) for face in faces]
        return clips[0] if samples is None else Takes(tuple(clips))

    def blocks(
        self, audio: AudioSource, style: Style | None = None, **options: Unpack[Options]
    ) -> Blocks:
        """Animate one recording block by block: what `animate` gives, in the memory of a block.

        Blocks have 64 frames, the last fewer. In `window` mode they come as frames become final, in
        others when the last frame is known. Arguments and errors as of `animate`.
        """
        refuse_unknown("blocks", options, Options)
        request, neutral, waveform = self._asked(audio, style, options, None)
        still = self.result(request, neutral, waveform, self._still.codes, self._still.offsets)
        if options.get("mode") == "live":
            clip = self._live(still, request, options)
            return Blocks(dataclasses.replace(still, mode="live"), clip.n_frames, iter([clip]))
        memory = self.engine.encode(waveform)
        made = (
            self.result(request, neutral, waveform, codes[0], motion[0])
            for codes, motion in self.engine.blocks(memory, request)
        )
        return Blocks(still, memory.n_frames, made)

    def stream(
        self,
        style: Style | None = None,
        *,
        look_ahead_ms: float | None = None,
        vertices: bool | None = None,
        sample: int = 0,
        rest_in_quiet: bool = False,
    ) -> Stream:
        """Open a stream: a face that speaks while it listens, primed with a few seconds of speech.

        Args:
            style: see `animate`; `Stream.restyle` changes it.
            look_ahead_ms: speech after a block that its encoding hears; 200 by default.
            vertices: whether frames have offsets; by default if there are no weights to give.
            sample: which sample of every part, of a bundle that gives several.
            rest_in_quiet: draw the face to rest where nobody speaks, and let it blink.
        """
        shown = not self.gives_weights if vertices is None else vertices
        request = self.request(style, {"mode": "live", "vertices": shown})
        return Stream(self._voices.voice(request, look_ahead_ms, sample, rest_in_quiet))

    def _live(self, still: Animation, request: Request, options: Options) -> Animation:
        return live_clip(self._voices.voice(request, options.get("look_ahead_ms")), still)

    def _asked(
        self, audio: AudioSource, style: Style | None, options: Options, samples: Samples | None
    ) -> tuple[Request, Template, Audio]:
        """What to generate, the neutral face, and the speech at the bundle's rate."""
        hold, progress = options.get("hold"), options.get("progress", False)
        if options.get("mode") == "live" or options.get("look_ahead_ms") is not None:
            refuse_in_live(options, samples, hold)
        request = self.request(style, options, samples, hold, progress)
        template = options.get("template")
        neutral = self._still.template if template is None else self.bundle.neutral(template)
        longer = self.for_long_speech(request, options)
        rate = self.manifest.sample_rate
        waveform = load_audio(audio, rate, options.get("sample_rate"))
        is_long = len(waveform) > LONGEST_EXACT_S * rate
        return longer if is_long else request, neutral, waveform

    def for_long_speech(self, request: Request, options: BatchOptions) -> Request:
        """The request for speech beyond LONGEST_EXACT_S: another one in mode `auto`.

        The cost of `exact` grows with the square of the clip: 15 s of speech take the packaged
        model twice as long as `window`, a minute thirteen times.
        """
        if options.get("mode") not in (None, "auto") or "window" not in self.manifest.modes:
            return request
        return dataclasses.replace(request, window=self.window("window", options.get("window")))

    def request(
        self,
        style: Style | None,
        options: BatchOptions,
        samples: Samples | None = None,
        hold: Held | None = None,
        progress: bool = False,
    ) -> Request:
        """What to generate, checked against the bundle; errors as of `animate`."""
        frames, mode = options.get("window"), options.get("mode")
        if mode in (None, "auto"):
            mode = "exact" if frames is None else "window"
        window = self.window(mode, frames)
        weights = style_weights(style, self.styles)
        vertices = options.get("vertices", True)
        return self.engine.request(weights, window, samples, hold, vertices, progress)

    def window(self, mode: str | None, frames: int | None) -> Window | None:
        """How `mode` decodes, the bundle's choices by default; ModeError if it cannot.

        A stream shows a frame early; see docs/live.md.
        """
        if mode == "live":
            return live_window(frames, self.manifest, self.engine.smallest_window)
        return window_of(mode, frames, self.manifest.modes, self.engine.smallest_window)

    def result(
        self, request: Request, neutral: Template, waveform: Audio, codes: Codes, motion: AnyArray
    ) -> Animation:
        """Codes (T, H) and motion as a clip, with what the bundle knows of the face.

        Motion is offsets (T, V, 3), or the products (T, K) of a request without vertices.
        """
        offsets, weights = motion, None
        if not request.vertices:
            assert self._problem is not None, "checked by the request"
            offsets, weights = np.empty((len(codes), 0, 3), np.float32), self._problem.solve(motion)
        mix = zip(self.styles, request.weights, strict=True)
        return dataclasses.replace(
            self._still,
            offsets=offsets,
            codes=codes,
            template=neutral,
            audio=waveform,
            styles={name: float(weight) for name, weight in mix if weight},
            mode="exact" if request.window is None else "window",
            known_weights=weights,
        )

    @cached_property
    def _problem(self) -> WeightProblem | None:
        return WeightProblem.of(self.bundle.rig.deltas) if self.bundle.rig is not None else None

    @cached_property
    def _voices(self) -> Voices:
        return Voices(self.engine, self.bundle, self._problem)

    def decode(self, codes: Codes) -> Offsets:
        """Codes (T, H), or (B, T, H), to offsets (T, V, 3), or (B, T, V, 3); CodesError."""
        array = np.asarray(codes)
        return self.engine.decode(array) if array.ndim != 2 else self.engine.decode(array[None])[0]
