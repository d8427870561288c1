"""Makes tests/data/cdface-tiny: a bundle of random weights and what the torch networks say.

    python tests/data/make_cdface_golden.py

The expected codes and vertices are those of the plain algorithm (`predict_parts`), which shares no
fast path with the bundle beside them.
"""

from __future__ import annotations

import dataclasses
from itertools import product
from pathlib import Path

import numpy as np
import torch

from facecode.audio import SPEECH, load_audio
from facecode.level import normalise
from facecode_exporter.bundles.neutral import read_neutral
from facecode_exporter.bundles.writer import write_bundle
from facecode_exporter.nets.cdface import predict_parts
from facecode_exporter.nets.speech import samples_for
from facecode_exporter.random_weights import random_network
from facecode_spec.systems.cdface_tiny import SPEC

OUT = Path(__file__).with_name("cdface-tiny")
SEED, N_FRAMES = 7, 33
WEIGHTS = (0.2, 0.5, 0.3)


def main() -> None:
    """Write the bundle and expected.npz."""
    net = random_network(SPEC, SEED)
    order = np.random.default_rng(SEED).permutation(SPEC.n_vertices).astype(np.int32)
    n_lips = SPEC.vertices_of(SPEC.part("lips"))
    parts = {"lips": np.sort(order[:n_lips]), "upper_face": np.sort(order[n_lips:])}
    neutral = dataclasses.replace(read_neutral(None, SPEC.n_vertices), parts=parts)
    write_bundle(net, OUT / "bundle", neutral, sources={})

    n_samples = samples_for(SPEC.speech_encoder, SPEC.fps, N_FRAMES)
    audio = load_audio(SPEECH, SPEC.speech_encoder.sample_rate)[8000 : 8000 + n_samples]
    faces = np.array(list(product(*(range(part.n_samples) for part in SPEC.parts))))
    with torch.no_grad():
        speech = net.audio_encoder(torch.from_numpy(normalise(audio))[None])
    truth = predict_parts(
        net.part_nets,
        speech.expand(len(faces), -1, -1),
        torch.tensor(WEIGHTS).expand(len(faces), -1),
        {part.name: torch.from_numpy(faces[:, i]) for i, part in enumerate(SPEC.parts)},
    )
    offsets = np.empty((len(faces), N_FRAMES, SPEC.n_vertices, 3), np.float32)
    for name, own in parts.items():
        offsets[:, :, own] = truth[name].offsets.numpy()
    codes = np.concatenate([p.codes.numpy() for p in truth.values()], axis=-1).astype(np.uint8)
    np.savez_compressed(
        OUT / "expected.npz", audio=audio, weights=np.float32(WEIGHTS), codes=codes, offsets=offsets
    )


if __name__ == "__main__":
    main()
