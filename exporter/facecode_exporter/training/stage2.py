"""Stage 2: speech to code features, teacher forced, the motion prior frozen (section 3.2).

Token 0 is the style embedding alone, as it is when the system is used; the public training code
adds the embedding of a zero motion there, which differs by that layer's bias.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from facecode.arrays import Float32
from facecode_exporter.data.clips import Clips, PartClips, batches, lessons_of
from facecode_exporter.measures.lip_sync import CLOSED_BELOW
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.losses import stage2_terms, straight_through
from facecode_exporter.training.speech_rows import SpeechRows


class Stage2:
    """Trains everything but the autoencoder."""

    terms: tuple[str, ...] = ("motion", "features")

    def __init__(self, net: CodeTalker, train: Clips, val: Clips, config: TrainingConfig) -> None:
        self.net, self.config = net, config
        self.trained: nn.Module = net
        net.autoencoder.requires_grad_(False)
        net.drop(config.decoder_dropout)
        self.splits = {"train": train, "val": val}
        self.speech = SpeechRows(
            net.system, net.audio_encoder, self.splits, config, config.fine_tune_speech
        )
        self.open = {split: self._open_frames(clips) for split, clips in self.splits.items()}

    def lessons(self) -> Iterator[Float32]:
        """Motion and style."""
        return lessons_of(self.splits["train"])

    def epoch(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, list[Tensor]]]:
        """(loss, terms) of every batch."""
        self.net.autoencoder.eval()
        if not self.config.fine_tune_speech:
            self.net.audio_encoder.eval()
        lengths = self.speech.lengths["train"]
        for group in batches(lengths, self.config.batch_size, self.config.crop_frames, rng):
            terms = self._terms("train", group)
            weights = (self.config.motion_weight, self.config.reg_weight)
            yield torch.stack([w * t for w, t in zip(weights, terms, strict=False)]).sum(), terms

    def end_epoch(self, rng: np.random.Generator) -> None:
        """Nothing to do."""

    @torch.no_grad()
    def validate(self) -> list[float]:
        """Teacher-forced terms over the validation clips, each frame counting the same."""
        self.net.eval()
        sums, n_frames = np.zeros(len(self.terms)), 0
        for i, length in enumerate(self.speech.lengths["val"]):
            sums += [length * float(t) for t in self._terms("val", [(i, 0, length)])]
            n_frames += length
        return list(sums / n_frames)

    def _terms(self, split: str, group: list[tuple[int, int, int]]) -> list[Tensor]:
        net, clips = self.net, self.splits[split]
        offsets = torch.stack(
            [torch.from_numpy(clips.offsets(i)[start : start + n]) for i, start, n in group]
        )
        styles = torch.tensor([clips.style(i) for i, _, _ in group])
        speech = F.dropout(
            self.speech.batch(split, group, self.config.streamed_share),
            self.config.speech_dropout,
            training=net.training,
        )
        memory = net.audio_feature_map(speech)
        past = offsets
        if net.training and self.config.own_history:
            past = self._own_past(offsets, styles, memory)
        features = net.features(self._tokens(past, styles), memory)
        return self.compare(offsets, features, self._counts(split, group))

    def _open_frames(self, clips: Clips) -> Sequence[NDArray[np.bool_]] | None:
        """(T,) of each clip: whether the mouth is open; None where all frames count alike."""
        if self.config.closed_weight == 1:
            return None
        return cast(PartClips, clips).open_mouth(CLOSED_BELOW)

    def _counts(self, split: str, group: list[tuple[int, int, int]]) -> Tensor:
        """(B, T) how often each frame counts."""
        frames = self.open[split]
        if frames is None:
            return torch.ones(len(group), group[0][2])
        is_open = torch.stack(
            [torch.from_numpy(frames[i][start : start + n]) for i, start, n in group]
        )
        return torch.where(is_open, 1.0, self.config.closed_weight)

    def compare(self, offsets: Tensor, features: Tensor, counts: Tensor) -> list[Tensor]:
        """The terms for true offsets (B, T, 3V), features (B, T, H, C) and counts (B, T)."""
        prior = self.net.autoencoder
        with torch.no_grad():
            true_vectors = prior.quantize.look_up(prior.quantize(prior.encoder(offsets)))
        vectors = prior.quantize.look_up(prior.quantize(features))
        decoded = prior.decoder(straight_through(features, vectors))
        return stage2_terms(offsets, decoded, features, true_vectors, counts)

    @torch.no_grad()
    def _own_past(self, offsets: Tensor, styles: Tensor, memory: Tensor) -> Tensor:
        """Nothing for the first half of the batch, the network's own motion for the other."""
        half = len(offsets) // 2
        none = torch.zeros_like(offsets)
        features = self.net.features(self._tokens(none[half:], styles[half:]), memory[half:])
        _, own = self.net.decode(features)
        return torch.cat([none[:half], own])

    def _tokens(self, past: Tensor, styles: Tensor) -> Tensor:
        """Style, then the past motion (B, T, 3V) one frame late: (B, T, D)."""
        return self.net.tokens(self.net.learnable_style_emb(styles), past[:, :-1], {})
