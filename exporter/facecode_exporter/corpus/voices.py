"""Voices that speak text: a neural one turned into several speakers, and flite's.

Comes in: a sentence and a seed. Goes out: 16 kHz mono float32 that begins and ends near silence.
The same sentence and seed give the same sound. Knows nothing of faces or files of the corpus.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from facecode.arrays import Audio, Float32
from facecode.audio import load_audio
from facecode_exporter.corpus.phones import SAMPLE_RATE
from facecode_exporter.errors import CorpusError

if TYPE_CHECKING:
    from hibari import Hibari

HIBARI_RATE = 24000
PITCH_SPREAD, THROAT_SPREAD = 1.12, 1.06  # each sentence is said by a slightly different person
SOURCES: Mapping[str, str] = {
    "hibari": "hibari-tts 0.2.1, voice 'heart', Apache-2.0",
    "flite": "CMU Flite 2.2, BSD-like",
}


@dataclass(frozen=True)
class Voice:
    """One speaker of the corpus."""

    name: str
    source: str
    """hibari or flite"""
    pitch: float = 1.0
    """factor on the fundamental frequency (hibari)"""
    formants: float = 1.0
    """factor on the resonances: below 1 is a longer throat (hibari)"""
    pace: float = 1.0
    held_out: bool = False
    """heard in the test split only"""


VOICES: tuple[Voice, ...] = (
    Voice("heart", "hibari"),
    Voice("alto", "hibari", pitch=0.82, formants=0.96, pace=0.95),
    Voice("tenor", "hibari", pitch=0.62, formants=0.88, pace=1.05),
    Voice("baritone", "hibari", pitch=0.52, formants=0.84, pace=0.95),
    Voice("bright", "hibari", pitch=1.12, formants=1.05, pace=1.1),
    Voice("child", "hibari", pitch=1.25, formants=1.11),
    Voice("unheard", "hibari", pitch=0.7, formants=0.92, held_out=True),
    Voice("slt", "flite"),
    Voice("rms", "flite"),
    Voice("awb", "flite"),
    Voice("kal16", "flite", held_out=True),
)


def available_voices() -> tuple[Voice, ...]:
    """VOICES without those of flite where the program `flite` is not installed."""
    has_flite = shutil.which("flite") is not None
    return tuple(voice for voice in VOICES if voice.source != "flite" or has_flite)


def speak(text: str, voice: Voice, seed: int, pace: float = 1.0) -> Audio:
    """(n,) the sentence at 16 kHz.

    Raises:
        CorpusError: the voice is not installed or gives no sound.
    """
    rng = np.random.default_rng(seed)
    if voice.source == "flite":
        return _flite(text, voice.name, voice.pace * pace, _spread(THROAT_SPREAD, rng))
    pitch = voice.pitch * _spread(PITCH_SPREAD, rng)
    formants = voice.formants * _spread(THROAT_SPREAD, rng)
    return _hibari(text, pitch, formants, voice.pace * pace, rng)


def _spread(most: float, rng: np.random.Generator) -> float:
    """A factor between 1 / most and most."""
    return float(most ** rng.uniform(-1, 1))


def _hibari(
    text: str, pitch: float, formants: float, pace: float, rng: np.random.Generator
) -> Audio:
    from hibari import dsp

    engine = _engine()
    parts = []
    for phonemes in engine.phonemize(text):
        feed = {
            "ids": np.asarray([engine.ids(phonemes)], np.int64),
            "speed": np.asarray([pace], np.float32),
        }
        *spectra, f0 = (output[0] for output in engine.sess.run(None, feed))
        warped = [_warped(spectrum, formants) for spectrum in spectra]
        parts.append(dsp.synth(*warped, f0 * np.float32(pitch), rng))
    if not parts:
        raise CorpusError(f"{text!r} leaves the voice nothing to say; give words")
    return load_audio(np.concatenate(parts).astype(np.float32), SAMPLE_RATE, HIBARI_RATE)


def _warped(spectrum: Float32, formants: float) -> Float32:
    """(n_bins, T) with its content moved to `formants` times the frequency."""
    n_bins = len(spectrum)
    source = np.minimum(np.arange(n_bins) / formants, n_bins - 1)
    low = np.minimum(source.astype(np.int64), n_bins - 2)
    share = (source - low)[:, None].astype(np.float32)
    return np.asarray((1 - share) * spectrum[low] + share * spectrum[low + 1])


@cache
def _engine() -> Hibari:
    from hibari import Hibari

    return Hibari(threads=1)


def _flite(text: str, name: str, pace: float, tape: float) -> Audio:
    """Spoken slower by `tape` and played faster by it: pitch and resonances rise alike."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "speech.wav")
        options: list[Any] = ["-voice", name, "--setf", f"duration_stretch={tape / pace:.4f}"]
        command = ["flite", *options, "-t", text, "-o", out]
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=60)
        except (OSError, subprocess.SubprocessError) as error:
            raise CorpusError(
                f"flite cannot speak as {name} ({error}); install the Debian package flite, "
                "or leave its voices out"
            ) from error
        spoken = load_audio(out, SAMPLE_RATE)
        return load_audio(spoken, SAMPLE_RATE, round(SAMPLE_RATE * tape))
