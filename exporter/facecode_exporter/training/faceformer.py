"""FaceFormer: speech to motion, on its own past as when it is used, or teacher forced.

On its own past the gradient runs through every earlier frame, as in the public code.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from facecode.arrays import Float32
from facecode_exporter.data.clips import Clips, batches, lessons_of
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.speech_rows import SpeechRows


class FaceFormerStage:
    """Trains the whole network but the convolutions of its speech encoder."""

    terms = ("motion",)

    def __init__(self, net: FaceFormer, train: Clips, val: Clips, config: TrainingConfig) -> None:
        self.net, self.config = net, config
        self.trained: nn.Module = net
        self.splits = {"train": train, "val": val}
        self.speech = SpeechRows(
            net.system, net.audio_encoder, self.splits, config, config.fine_tune_speech
        )
        net.drop(config.decoder_dropout)

    def lessons(self) -> Iterator[Float32]:
        """Motion and style."""
        return lessons_of(self.splits["train"])

    def epoch(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, list[Tensor]]]:
        """(loss, terms) of every batch."""
        lengths = self.speech.lengths["train"]
        for group in batches(lengths, self.config.batch_size, self.config.crop_frames, rng):
            loss = self.loss("train", group, self.config.teacher_forcing)
            yield loss, [loss]

    def end_epoch(self, rng: np.random.Generator) -> None:
        """Nothing to do."""

    @torch.no_grad()
    def validate(self) -> list[float]:
        """The term on the network's own past over the validation clips, by frame."""
        self.net.eval()
        lengths = self.speech.lengths["val"]
        losses = [float(self.loss("val", [(i, 0, n)], False)) for i, n in enumerate(lengths)]
        return [float(np.average(losses, weights=lengths))]

    def loss(self, split: str, group: list[tuple[int, int, int]], teacher_forcing: bool) -> Tensor:
        """Mean squared error of the vertices of each (clip, start, n); all of one length."""
        net, clips = self.net, self.splits[split]
        truth = torch.stack(
            [torch.from_numpy(clips.offsets(i)[start : start + n]) for i, start, n in group]
        )
        style = net.style_rows[[clips.style(i) for i, _, _ in group]]
        speech = self.speech.batch(split, group, self.config.streamed_share)
        memory = net.audio_feature_map(speech)
        if teacher_forcing:
            said = net.offsets(net.motion_tokens(style, truth[:, :-1]), memory)
        else:
            said = own_motion(net, style, memory, truth.shape[1])
        return F.mse_loss(said, truth)


def own_motion(net: FaceFormer, style: Tensor, memory: Tensor, n_frames: int) -> Tensor:
    """Offsets (B, n_frames, 3V) on the network's own past, with gradients.

    The prefix is run again at every frame, as in the public code. Of it only the newest frame is
    new, since the network is causal; without dropout gradients are those of the public code.

    Args:
        net: the network.
        style: vectors of the styles (B, D).
        memory: (B, n_frames * rows, D).
        n_frames: how many.
    """
    tokens = style[:, None]
    said = []
    for _ in range(n_frames):
        newest = net.vertice_map_r(net.hidden(tokens, memory)[:, -1:])
        said.append(newest)
        tokens = torch.cat([tokens, net.vertice_map(newest) + style[:, None]], dim=1)
    return torch.cat(said, dim=1)
