"""The query network of one part of CDFace: speech and past motion to K samples of that part.

The motion prior is frozen, gradients pass its quantiser straight through. The paper teaches on the
true past; here half of the clips see no past and the other half the head's own prediction made
without history, as in `own_history` of stage 2.
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
from facecode_exporter.measures.regions import LIPS
from facecode_exporter.nets.cdface import CDFace
from facecode_exporter.nets.part import PartNet
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.diverse_losses import TERMS, diverse_terms, total
from facecode_exporter.training.losses import straight_through
from facecode_exporter.training.speech_rows import SpeechRows

Crop = tuple[int, int, int]
"""(clip, first frame, frames)"""


class QueryStage:
    """Trains the network of one part, and of the first part its speech encoder, if asked to."""

    terms = TERMS

    def __init__(
        self,
        net: CDFace,
        train: PartClips,
        val: PartClips,
        config: TrainingConfig,
        speech: SpeechRows | None = None,
    ) -> None:
        """Freeze all but one part.

        Args:
            net: the system.
            train: clips of the part to learn from.
            val: and to validate on.
            config: with `losses` and `part`.
            speech: of a stage before, over the same clips and the same frozen encoder.
        """
        assert config.losses is not None
        assert config.part is not None
        self.config, self.losses = config, config.losses
        self.trained: nn.Module = net.requires_grad_(False)
        names = [other.part.name for other in net.part_nets]
        place = names.index(config.part)
        self.earlier, self.net = net.part_nets[:place], net.part_nets[place]
        self.net.requires_grad_(True)
        self.net.drop(config.decoder_dropout)
        for earlier in self.earlier:
            earlier.drop(0.0)
        self.net.autoencoder.requires_grad_(False)
        self.splits = {"train": train, "val": val}
        self.speech = speech or SpeechRows(
            net.system,
            net.audio_encoder,
            dict(self.splits),
            config,
            place == 0 and config.fine_tune_speech,
        )
        self.open = {
            s: clips.open_mouth(self.losses.closed_below) for s, clips in self.splits.items()
        }
        self.unit = root_mean_square(train)

    def lessons(self) -> Iterator[Float32]:
        """Motion, style, and where the mouth is open."""
        yield from lessons_of(self.splits["train"])
        for is_open in self.open["train"]:
            yield is_open.astype(np.float32)

    def epoch(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, list[Tensor]]]:
        """(loss, terms) of every batch."""
        for net in (*self.earlier, self.net):
            net.autoencoder.eval()
        lengths = self.speech.lengths["train"]
        for group in batches(lengths, self.config.batch_size, self.config.crop_frames, rng):
            terms = self._terms("train", group)
            yield total(terms, self.losses, self.net.part.n_samples), terms

    def end_epoch(self, rng: np.random.Generator) -> None:
        """Nothing to do."""

    @torch.no_grad()
    def validate(self) -> list[float]:
        """Terms over the validation clips on the network's own past, each frame alike."""
        self.trained.eval()
        sums, n_frames = np.zeros(len(self.terms)), 0
        for i, length in enumerate(self.speech.lengths["val"]):
            sums += [length * float(t) for t in self._terms("val", [(i, 0, length)])]
            n_frames += length
        return list(sums / n_frames)

    @torch.no_grad()
    def head_errors(self) -> Tensor:
        """(K,) mean squared error of each head over the validation clips, each clip alike."""
        self.trained.eval()
        sums = torch.zeros(self.net.part.n_samples)
        for i, length in enumerate(self.speech.lengths["val"]):
            group = [(i, 0, length)]
            (samples,) = self._decoded(self._said("val", group)[1])
            sums += (samples - self._truth("val", group)).square().mean(dim=(1, 2))
        return sums / len(self.speech.lengths["val"])

    def _terms(self, split: str, group: list[Crop]) -> list[Tensor]:
        truth = self._truth(split, group)
        open_mouth = _stack([self.open[split][i][a : a + n] for i, a, n in group]).float()
        if not (self.losses.mask and self.net.part.name == LIPS):
            open_mouth = torch.ones_like(open_mouth)
        features, vectors = self._said(split, group)
        samples = self._decoded(straight_through(features, vectors))
        prior = self.net.autoencoder
        with torch.no_grad():
            true_vectors = prior.quantize.look_up(prior.quantize(prior.encoder(truth)))
        return diverse_terms(
            *(samples / self.unit, truth / self.unit, open_mouth),
            *(features, vectors, true_vectors),
            self.losses.half_at,
        )

    def _truth(self, split: str, group: list[Crop]) -> Tensor:
        """(B, T, 3V) of the crops."""
        return _stack([self.splits[split].offsets(i)[a : a + n] for i, a, n in group])

    def _said(self, split: str, group: list[Crop]) -> tuple[Tensor, Tensor]:
        """Features (B, K, T, H, C) of all heads, and their nearest code vectors."""
        styles = torch.tensor([self.splits[split].style(i) for i, _, _ in group])
        speech = self.speech.batch(split, group, self.config.streamed_share)
        conditions = self._conditions(speech, styles)
        speech = F.dropout(speech, self.config.speech_dropout, training=self.net.training)
        features = self._features(self.net.audio_feature_map(speech), styles, conditions)
        quantize = self.net.autoencoder.quantize
        return features, quantize.look_up(quantize(features))

    def _decoded(self, vectors: Tensor) -> Tensor:
        """Code vectors (B, K, T, H, C) to offsets (B, K, T, 3V)."""
        decoded = self.net.autoencoder.decoder(vectors.flatten(0, 1))
        return cast(Tensor, decoded.unflatten(0, vectors.shape[:2]))

    def _features(self, memory: Tensor, styles: Tensor, conditions: dict[str, Tensor]) -> Tensor:
        """(B, K, T, H, C): without a past for half of the clips, with its own for the others."""
        half = (len(memory) + int(torch.randint(2, ()))) // 2 if self.net.training else 0
        predicted = []
        if half > 0:
            before = _rows(conditions, slice(half))
            predicted.append(unprompted(self.net, memory[:half], styles[:half], before))
        if half < len(memory):
            after = _rows(conditions, slice(half, None))
            predicted.append(self._with_own_past(memory[half:], styles[half:], after))
        return torch.cat(predicted)

    def _with_own_past(
        self, memory: Tensor, styles: Tensor, conditions: dict[str, Tensor]
    ) -> Tensor:
        """(B, K, T, H, C): every sample goes on from what its own head says without a past."""
        with torch.no_grad():
            first = unprompted(self.net, memory, styles, conditions)
            _, past = self.net.autoencoder.decode_features(first.flatten(0, 1))
        k = self.net.part.n_samples
        sample = torch.arange(k).repeat(len(memory))
        memory, styles = (x.repeat_interleave(k, dim=0) for x in (memory, styles))
        conditions = {n: c.repeat_interleave(k, dim=0) for n, c in conditions.items()}
        features = continued(self.net, memory, styles, conditions, past, sample)
        return cast(Tensor, features.unflatten(0, (-1, k)))

    @torch.no_grad()
    def _conditions(self, speech: Tensor, styles: Tensor) -> dict[str, Tensor]:
        """Code vectors of the earlier parts, of one random sample of each for every clip."""
        vectors: dict[str, Tensor] = {}
        for net in self.earlier:
            memory = net.audio_feature_map(speech)
            picked = torch.randint(net.part.n_samples, (len(speech),))
            first = unprompted(net, memory, styles, vectors)[torch.arange(len(speech)), picked]
            _, past = net.autoencoder.decode_features(first)
            features = continued(net, memory, styles, vectors, past, picked)
            quantize = net.autoencoder.quantize
            vectors[net.part.name] = quantize.look_up(quantize(features))
        return vectors


def unprompted(net: PartNet, memory: Tensor, styles: Tensor, vectors: dict[str, Tensor]) -> Tensor:
    """Features (B, K, T, H, C) of all heads with no past at all, over memory (B, T * rows, D)."""
    n_rows = net.system.speech_encoder.memory_rows_per_frame
    n_frames = memory.shape[1] // n_rows
    past = memory.new_zeros(len(memory), n_frames - 1, 3 * net.n_vertices)
    tokens = net.tokens(net.learnable_style_emb(styles), past, vectors)
    return net.every_head(tokens, memory).transpose(1, 2)


def continued(
    net: PartNet,
    memory: Tensor,
    styles: Tensor,
    conditions: dict[str, Tensor],
    past: Tensor,
    sample: Tensor,
) -> Tensor:
    """Features (B, T, H, C) of head `sample[b]` with the past (B, T, 3V) of its own row."""
    tokens = net.tokens(net.learnable_style_emb(styles), past[:, :-1], conditions)
    return net.features(tokens, memory, sample)


def root_mean_square(clips: Clips) -> float:
    """Of all offsets of a split."""
    squares, n = 0.0, 0
    for i in range(len(clips.names)):
        offsets = clips.offsets(i)
        squares += float(np.square(offsets, dtype=np.float64).sum())
        n += offsets.size
    return float(np.sqrt(squares / n))


def _rows(conditions: dict[str, Tensor], which: slice) -> dict[str, Tensor]:
    return {name: vectors[which] for name, vectors in conditions.items()}


def _stack(arrays: Sequence[NDArray[np.generic]]) -> Tensor:
    return torch.stack([torch.from_numpy(np.ascontiguousarray(a)) for a in arrays])
