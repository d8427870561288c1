"""The packaged model's network without its codebook: speech to motion directly, as FaceFormer does.

FaceFormer (Fan et al., CVPR 2022) regresses motion where CodeTalker chooses codes; CodeTalker's
claim is better upper-face dynamics (FDD) at equal or better LVE. Same corpus, speech encoder, size
of the decoder and training; the last layer gives coefficients of the motion, not code features.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from facecode.arrays import Float32
from facecode.audio import load_audio
from facecode_exporter.data.corpus_data import CorpusData
from facecode_exporter.data.data_set import subject_of
from facecode_exporter.demo.coefficients import CorpusClips, MotionBasis, corpus_basis
from facecode_exporter.demo.whisper_wheel import whisper_weights
from facecode_exporter.evaluation.distances import ScoredClip, Take, scored_clip
from facecode_exporter.measures.regions import Regions
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.losses import counted_mse
from facecode_exporter.training.run import train
from facecode_exporter.training.stage2 import Stage2
from facecode_spec.schema import CodebookSpec, SystemSpec
from facecode_spec.systems.codetalker_demo import SPEC


class Regression(CodeTalker):
    """CodeTalker whose features are the motion: one "code" a frame, 3V numbers, not quantised."""

    def decode(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Features (B, n, 1, 3V) to no codes (B, n, 1) and offsets (B, n, 3V)."""
        return torch.zeros(features.shape[:3], dtype=torch.int64), features.flatten(2)


class RegressionStage(Stage2):
    """Stage 2 with the motion term alone; there is no prior to stay near to."""

    terms = ("motion",)

    def compare(self, offsets: Tensor, features: Tensor, counts: Tensor) -> list[Tensor]:
        """Mean squared error of the offsets (B, T, 3V)."""
        return [counted_mse(features.flatten(2), offsets, counts)]


def without_codebook(system: SystemSpec) -> SystemSpec:
    """`system` with one unquantised "code" of 3V numbers a frame."""
    (part,) = system.parts
    _, decoder = part.prior
    book = CodebookSpec(n_codes=1, codes_per_frame=1, dim=3 * system.n_vertices)
    decoder = dataclasses.replace(decoder, input_projection=True)
    part = dataclasses.replace(part, codebook=book, motion_decoder=decoder)
    return dataclasses.replace(system, name=f"{system.name}-regression", parts=(part,))


def train_baseline(
    corpus: Path,
    whisper_wheel: Path,
    config: TrainingConfig,
    work: Path,
    progress: bool = True,
) -> tuple[Regression, MotionBasis]:
    """The trained network on coefficients, and the basis that lifts them to vertices.

    Raises:
        CorpusError, CheckpointError, RunError.
    """
    basis = corpus_basis(corpus)
    torch.manual_seed(config.seed)
    net = Regression(without_codebook(basis.system(SPEC)))
    net.audio_encoder.load_state_dict(whisper_weights(whisper_wheel))
    clips = {s: CorpusClips(corpus, s, basis, SPEC.styles) for s in ("train", "val")}
    stage = RegressionStage(net, clips["train"], clips["val"], config)
    train(stage, config, work / "regression", progress)
    return net, basis


def score_baseline(
    net: Regression, basis: MotionBasis, data: CorpusData, regions: Regions, progress: bool = True
) -> Iterator[ScoredClip]:
    """Animate each clip in its own style, frame after frame on its own past, and score it."""
    net.eval()
    for clip in tqdm(data.clips, desc="baseline", unit="clip", disable=not progress):
        style = subject_of(clip)
        weights = torch.from_numpy(np.eye(len(SPEC.styles), dtype=np.float32))
        row = weights[[SPEC.styles.index(style)]]
        audio = load_audio(data.speech(clip), SPEC.speech_encoder.sample_rate)
        prediction = net.predict(torch.from_numpy(audio)[None], row).offsets[0]
        offsets = (prediction.flatten(1).double() @ basis.decode.T).unflatten(-1, (-1, 3))
        vertices: Float32 = offsets.numpy().astype(np.float32) + data.template(clip)
        yield scored_clip(Take(clip, style), vertices, data, regions)
