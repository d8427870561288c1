"""The speech that every stream begins after, animated once for each way to stream, then copied."""

from __future__ import annotations

import threading

import numpy as np

from facecode.arrays import Audio
from facecode.audio import SPEECH, load_audio
from facecode.bundle import Bundle
from facecode.bundle_files import load_array
from facecode.errors import ManifestError
from facecode.live.loop import LiveLoop
from facecode.live.plan import Plan
from facecode.loop.engine import Engine
from facecode.loop.request import Request

PRIMER_S = 3
LONGEST_S = 30
MOST_KEPT = 16
"""Styles and plans whose loops are kept, a few MB each; the one least lately used goes first."""


class PrimedLoops:
    """Loops that have heard the primer; threads may share it."""

    def __init__(self, engine: Engine, primer: Audio) -> None:
        """Begin streams as if `primer` (n_samples,) of whole seconds had been spoken before.

        A face that begins from nothing trembles for seconds, and an encoder that hears nothing but
        quiet takes it for speech.
        """
        self.engine, self._primer = engine, primer
        self._kept: dict[tuple[object, ...], LiveLoop] = {}
        self._lock = threading.Lock()

    def loop(self, request: Request, plan: Plan) -> LiveLoop:
        """A loop of one's own that has just heard the primer."""
        heads = sorted((name, rows.tobytes()) for name, rows in request.heads.items())
        key = (plan, request.window, request.weights.tobytes(), *heads)
        with self._lock:
            primed = self._kept.pop(key, None)
            if primed is None:
                primed = LiveLoop(self.engine, request, plan, self._primer)
            self._kept[key] = primed
            if len(self._kept) > MOST_KEPT:
                del self._kept[next(iter(self._kept))]
        return primed.copy()


def primer_of(bundle: Bundle) -> Audio:
    """The bundle's primer, or the first seconds of the packaged recording.

    Raises:
        ManifestError: a primer that is none.
    """
    m = bundle.manifest
    if m.live is None or m.live.primer is None:
        return load_audio(SPEECH, m.sample_rate)[: PRIMER_S * m.sample_rate]
    primer = load_array(bundle.root, m.live.primer, (-1,), np.float32)
    seconds, rest = divmod(len(primer), m.sample_rate)
    if rest or not 1 <= seconds <= LONGEST_S or not np.isfinite(primer).all():
        raise ManifestError(
            f"{m.live.primer} holds {len(primer)} samples; expected 1 to {LONGEST_S} whole seconds "
            f"at {m.sample_rate} Hz, all of them finite"
        )
    return primer
