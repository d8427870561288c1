"""How loud and how high the voice is, for each frame of motion.

Comes in: 16 kHz mono float32. Goes out: one value a frame of motion. Knows nothing of faces.
"""

from __future__ import annotations

import numpy as np

from facecode.arrays import Audio, Float32
from facecode_exporter.corpus.phones import SAMPLE_RATE

WINDOW_S = 0.04
LOWEST_HZ, HIGHEST_HZ = 60.0, 450.0
VOICED = 0.45  # of the autocorrelation at lag 0


def frame_times(n_frames: int, fps: float) -> Float32:
    """(n_frames,) seconds from the start of the recording."""
    return np.asarray(np.arange(n_frames) / fps, np.float32)


def frame_windows(audio: Audio, n_frames: int, fps: float) -> Float32:
    """(n_frames, n_samples) the 40 ms around each frame's time, zeros beyond the ends."""
    size = int(WINDOW_S * SAMPLE_RATE)
    centres = np.rint(np.arange(n_frames) / fps * SAMPLE_RATE).astype(np.int64)
    padded = np.concatenate([np.zeros(size // 2), audio, np.zeros(size + SAMPLE_RATE)])
    return np.asarray(padded[centres[:, None] + np.arange(size)], np.float32)


def loudness(windows: Float32) -> Float32:
    """(n_frames,) dB below the loud part of the recording: 0 at its 95 % quantile, at least -60."""
    level = 10 * np.log10(np.square(windows).mean(axis=1) + 1e-10)
    return np.asarray(np.maximum(level - np.quantile(level, 0.95), -60), np.float32)


def pitch(windows: Float32) -> Float32:
    """(n_frames,) semitones above the voice's median; NaN where there is no voice."""
    n = windows.shape[1]
    spectrum = np.fft.rfft(windows - windows.mean(axis=1, keepdims=True), 2 * n, axis=1)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, axis=1)[:, :n]
    correlation *= n / np.arange(n, 0, -1)
    low, high = int(SAMPLE_RATE / HIGHEST_HZ), min(int(SAMPLE_RATE / LOWEST_HZ), n - 1)
    lag = low + correlation[:, low:high].argmax(axis=1)
    height = correlation[np.arange(len(lag)), lag] / (correlation[:, 0] + 1e-9)
    voiced = (height > VOICED) & (loudness(windows) > -30)
    semitones = np.full(len(lag), np.nan, np.float32)
    semitones[voiced] = 12 * np.log2(SAMPLE_RATE / lag[voiced])
    return semitones - np.nanmedian(semitones) if voiced.any() else semitones
