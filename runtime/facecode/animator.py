"""The door of the runtime: a loaded bundle that animates recordings.

Equivalence: `exact` decodes the whole prefix at every step and gives the trained system's codes,
for audio that is encoded in one pass (see `speech.py`). `window` decodes W frames at every step
and equals `exact` for clips of up to W frames. Samples and clips on the batch axis give what they
give alone.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, overload

import numpy as np

from facecode.animation import Animation
from facecode.arrays import Audio, Codes, Offsets, Template
from facecode.audio import AudioSource, load_audio
from facecode.bundle import Bundle
from facecode.loop.engine import Engine
from facecode.loop.request import Request, Window, refuse_unknown, style_weights, window_of
from facecode.options import BatchOptions, Held, Options, Samples, Style
from facecode.session import Compute
from facecode.takes import Takes
from facecode_spec.manifest import Manifest

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Animator:
    """A loaded bundle, ready to animate any number of clips; it keeps no state between them."""

    def __init__(self, bundle: Bundle, compute: Compute | None = None) -> None:
        """Load the graphs of `bundle`.

        Raises:
            GraphError, ManifestError, ProviderError.
        """
        self.bundle, self.compute = bundle, Compute() if compute is None else compute
        self.engine = Engine.open(bundle, self.compute)
        self._still = Animation.still(bundle)

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
            CodesError, GraphError.
        """
        refuse_unknown("animate", options, Options)
        hold, progress = options.get("hold"), options.get("progress", False)
        request = self.request(style, options, samples, hold, progress)
        template = options.get("template")
        neutral = self._still.template if template is None else self.bundle.neutral(template)
        waveform = load_audio(audio, self.manifest.sample_rate, options.get("sample_rate"))
        codes, offsets = self.engine.animate(waveform, request)
        faces = zip(codes, offsets, strict=True)
        clips = [self.result(request, neutral, waveform, *face) for face in faces]
        return clips[0] if samples is None else Takes(tuple(clips))

    def request(
        self,
        style: Style | None,
        options: BatchOptions,
        samples: Samples | None = None,
        hold: Held | None = None,
        progress: bool = False,
    ) -> Request:
        """What to generate, checked against the bundle.

        Raises:
            StyleError, ModeError, SampleError, CodesError.
        """
        window = self.window(options.get("mode"), options.get("window"))
        weights = style_weights(style, self.styles)
        return self.engine.request(weights, window, samples, hold, progress)

    def window(self, mode: str | None, frames: int | None) -> Window | None:
        """How `mode` decodes, the bundle's choices by default; ModeError if it cannot."""
        return window_of(mode, frames, self.manifest.modes, self.engine.smallest_window)

    def result(
        self, request: Request, neutral: Template, waveform: Audio, codes: Codes, offsets: Offsets
    ) -> Animation:
        """Codes (T, H) and offsets (T, V, 3) as a clip, with what the bundle knows of the face."""
        mix = zip(self.styles, request.weights, strict=True)
        styles = {name: float(weight) for name, weight in mix if weight}
        return dataclasses.replace(
            self._still,
            offsets=offsets,
            codes=codes,
            template=neutral,
            audio=waveform,
            styles=styles,
        )

    def decode(self, codes: Codes) -> Offsets:
        """Codes (T, H) of a clip, or (B, T, H) of several, to offsets (T, V, 3) or (B, T, V, 3).

        Raises:
            CodesError: another H, or codes outside the codebook.
        """
        array = np.asarray(codes)
        return self.engine.decode(array) if array.ndim != 2 else self.engine.decode(array[None])[0]
