"""Stage 1: the VQ autoencoder of facial motion (CodeTalker, section 3.1)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor

from facecode.arrays import Float32
from facecode_exporter.data.clips import Clips, batches
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.losses import stage1_terms, straight_through


class Stage1:
    """Trains an autoencoder on the motion of clips; speech and style play no part."""

    terms = ("reconstruction", "codebook", "commitment")

    def __init__(
        self, net: VQAutoencoder, train: Clips, val: Clips, config: TrainingConfig
    ) -> None:
        self.trained, self.config = net, config
        net.drop(config.position_dropout)
        self.motion = {"train": _load(train), "val": _load(val)}
        self._used = torch.zeros(net.quantize.embedding.num_embeddings, dtype=torch.int64)
        self._recent: list[Tensor] = []

    def lessons(self) -> Iterator[Float32]:
        """The motion."""
        return (clip.numpy() for clip in self.motion["train"])

    def epoch(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, list[Tensor]]]:
        """(loss, terms) of every batch."""
        clips = self.motion["train"]
        lengths = [len(c) for c in clips]
        self._used.zero_()
        for group in batches(lengths, self.config.batch_size, self.config.crop_frames, rng):
            offsets = torch.stack([clips[i][start : start + n] for i, start, n in group])
            terms = self._terms(offsets)
            yield terms[0] + terms[1] + self.config.commitment * terms[2], terms

    def _terms(self, offsets: Tensor) -> list[Tensor]:
        net = self.trained
        features = net.encoder(offsets)
        codes = net.quantize(features)
        vectors = net.quantize.look_up(codes)
        decoded = net.decoder(straight_through(features, vectors))
        self._used += torch.bincount(codes.flatten(), minlength=len(self._used))
        self._recent = [*self._recent[-7:], features.detach().flatten(0, -2)]
        return stage1_terms(offsets, decoded, features, vectors)

    @torch.no_grad()
    def end_epoch(self, rng: np.random.Generator) -> None:
        """Restart the codes that nothing was nearest to, at features of the last batches."""
        if not self.config.revive_codes:
            return
        dead = torch.nonzero(self._used == 0).flatten()
        pool = torch.cat(self._recent)
        chosen = torch.from_numpy(rng.integers(0, len(pool), len(dead)))
        self.trained.quantize.embedding.weight[dead] = pool[chosen]

    @torch.no_grad()
    def validate(self) -> list[float]:
        """Terms over the validation clips, each frame counting the same."""
        self.trained.eval()
        used, recent = self._used.clone(), self._recent
        sums, n_frames = np.zeros(len(self.terms)), 0
        for offsets in self.motion["val"]:
            sums += [len(offsets) * float(t) for t in self._terms(offsets[None])]
            n_frames += len(offsets)
        self._used, self._recent = used, recent
        return list(sums / n_frames)


def _load(clips: Clips) -> list[Tensor]:
    return [torch.from_numpy(clips.offsets(i)) for i in range(len(clips.names))]
