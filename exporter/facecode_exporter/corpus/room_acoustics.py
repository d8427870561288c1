"""What lies between a voice and its recording: a room, a microphone, a level, noise.

Comes in: clean speech at 16 kHz and a random generator. Goes out: the recording, as long as the
speech and in time with it. The same generator state gives the same recording.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from facecode.arrays import Audio
from facecode_exporter.corpus.phones import SAMPLE_RATE

Sound = NDArray[np.float64]

SHARE_WITH_ECHO, SHARE_WITH_TILT = 0.4, 0.5
ECHO_S = (0.15, 0.6)  # until it is 60 dB down
ECHO_DB = (-22.0, -6.0)  # against the direct sound
TILT_DB = (-3.0, 3.0)  # an octave, around 1 kHz
NOISE_DB = (-75.0, -32.0)
LEVEL_DB = (-12.0, -1.0)
EMPTY_DB = (-95.0, -15.0)
SHARE_OF_ZEROS = 0.3
GATE_EDGE_S = 0.06
SHARE_WITH_BREATH = 0.35
BREATH_S = (0.2, 0.6)
MAINS_HZ, N_OVERTONES, FAN_HZ = (50.0, 60.0), 8, (4.0, 40.0)
BREATH_DB = (-45.0, -22.0)  # against full scale, which voices nearly reach


def recorded(clean: Audio, rng: np.random.Generator) -> Audio:
    """As a microphone in some room would hear `clean` (n,): (n,) in [-1, 1]."""
    sound = np.asarray(clean, np.float64)
    if rng.random() < SHARE_WITH_ECHO:
        sound = sound + _echo(sound, rng)
    if rng.random() < SHARE_WITH_TILT:
        sound = _tilted(sound, rng.uniform(*TILT_DB))
    level, noise = 10 ** (rng.uniform(*LEVEL_DB) / 20), 10 ** (rng.uniform(*NOISE_DB) / 20)
    scaled = sound * (level / max(float(np.abs(sound).max()), 1e-3))
    noisy = scaled + noise * level * _noise(len(sound), rng)
    return np.asarray(np.clip(noisy, -1, 1), np.float32)


def with_breath(pause: Audio, rng: np.random.Generator) -> Audio:
    """`pause` (n,) in which, sometimes and where there is room, somebody breathes."""
    breathes, length_s, level_db = rng.random(), rng.uniform(*BREATH_S), rng.uniform(*BREATH_DB)
    n = round(length_s * SAMPLE_RATE)
    if breathes > SHARE_WITH_BREATH or n > len(pause):
        return pause
    first = int(rng.integers(len(pause) - n, endpoint=True))
    swell = np.sin(np.linspace(0, np.pi, n)) ** 2
    breath = 10 ** (level_db / 20) * swell * _noise(n, rng)
    sound = pause.copy()
    sound[first : first + n] += breath.astype(np.float32)
    return np.asarray(sound)


def gated(audio: Audio, pauses: Iterable[tuple[float, float]]) -> Audio:
    """`audio` (n,) as a noise gate leaves it: zeros in all but the edges of pauses (seconds)."""
    cut = audio.copy()
    for start_s, end_s in pauses:
        first, last = (start_s + GATE_EDGE_S) * SAMPLE_RATE, (end_s - GATE_EDGE_S) * SAMPLE_RATE
        cut[round(first) : max(round(first), round(last))] = 0
    return np.asarray(cut)


def empty_room(n_samples: int, rng: np.random.Generator) -> Audio:
    """(n_samples,) of noise, mains hum or a fan at any level, or of zeros."""
    if rng.random() < SHARE_OF_ZEROS:
        return np.zeros(n_samples, np.float32)
    level = 10 ** (rng.uniform(*EMPTY_DB) / 20)
    tone = ROOM_TONES[int(rng.integers(len(ROOM_TONES)))](n_samples, rng)
    return np.asarray(np.clip(level * tone, -1, 1), np.float32)


def _echo(clean: Sound, rng: np.random.Generator) -> Sound:
    """Decaying noise in place of each sound."""
    length_s, gain_db = rng.uniform(*ECHO_S), rng.uniform(*ECHO_DB)
    n_tail = round(length_s * SAMPLE_RATE)
    decay = 10 ** (-3 * np.arange(n_tail) / n_tail)
    tail = rng.standard_normal(n_tail) * decay
    tail *= 10 ** (gain_db / 20) / np.sqrt(np.square(tail).sum())
    size = len(clean) + n_tail
    echo = np.fft.irfft(np.fft.rfft(clean, size) * np.fft.rfft(tail, size), size)
    return np.asarray(echo[: len(clean)])


def _tilted(sound: Sound, db_per_octave: float) -> Sound:
    spectrum = np.fft.rfft(sound)
    frequency = np.fft.rfftfreq(len(sound), 1 / SAMPLE_RATE)
    octaves = np.log2(np.clip(frequency, 100, None) / 1000)
    return np.asarray(np.fft.irfft(spectrum * 10 ** (db_per_octave * octaves / 20), len(sound)))


def _noise(n_samples: int, rng: np.random.Generator) -> Sound:
    """White to brown noise of root mean square 1."""
    coloured = _tilted(rng.standard_normal(n_samples), rng.uniform(-6, 0))
    return _of_level_1(coloured)


def _hum(n_samples: int, rng: np.random.Generator) -> Sound:
    """The mains and its overtones above a little noise; root mean square 1."""
    times = np.arange(n_samples) / SAMPLE_RATE
    mains = rng.choice(MAINS_HZ) * rng.uniform(0.99, 1.01)
    overtones = [
        rng.uniform(0.1, 1) / k * np.sin(2 * np.pi * (k * mains * times + rng.random()))
        for k in range(1, N_OVERTONES + 1)
    ]
    return _of_level_1(np.sum(overtones, axis=0) + rng.uniform(0.02, 0.3) * _noise(n_samples, rng))


def _fan(n_samples: int, rng: np.random.Generator) -> Sound:
    """Noise that swells with the turning of blades; root mean square 1."""
    times = np.arange(n_samples) / SAMPLE_RATE
    turning = np.sin(2 * np.pi * (rng.uniform(*FAN_HZ) * times + rng.random()))
    return _of_level_1((1 + rng.uniform(0.1, 0.8) * turning) * _noise(n_samples, rng))


def _of_level_1(sound: Sound) -> Sound:
    return np.asarray(sound / max(float(np.sqrt(np.square(sound).mean())), 1e-9))


ROOM_TONES = (_noise, _hum, _fan)
