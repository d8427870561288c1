"""The clips on which every new bundle is compared with torch."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from facecode.audio import SPEECH, load_audio
from facecode_exporter.bundles.parity import Case
from facecode_exporter.nets.networks import Network
from facecode_exporter.nets.speech import samples_for


def parity_cases(net: Network) -> Iterator[Case]:
    """Real speech, 1, 2 and 3 frames long and past the period, each in another style.

    Where parts have several samples, short clips take all of them and the last two of each; with
    several parts a further case holds the first one.
    """
    system = net.system
    speech = load_audio(SPEECH, system.speech_encoder.sample_rate)
    styles = np.eye(len(system.styles), dtype=np.float32)
    mix = np.full(len(system.styles), 1 / len(system.styles), dtype=np.float32)
    longest = max(part.cross_modal_decoder.period for part in system.parts) + 7
    every = {part.name: part.n_samples for part in system.parts}
    two = {name: min(n, 2) for name, n in every.items()}
    for i, (n_frames, samples) in enumerate(
        zip((1, 2, 3, longest), (every, every, every, two), strict=True)
    ):
        n_samples = samples_for(system.speech_encoder, system.fps, n_frames)
        start = 4000 * i
        weights = mix if n_frames == longest else styles[i % len(styles)]
        yield Case(speech[start : start + n_samples], weights, samples)
    if len(system.parts) > 1:
        first, n_samples = system.parts[0], samples_for(system.speech_encoder, system.fps, 5)
        book, _ = first.prior
        codes = np.random.default_rng(0).integers(0, book.n_codes, (5, book.codes_per_frame))
        held = {name: n for name, n in two.items() if name != first.name}
        yield Case(speech[:n_samples], mix, held, {first.name: codes})
