"""The frozen or trained speech encoder's output, cut to the frames that a batch sees."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from facecode.arrays import Float32
from facecode.level import normalise
from facecode_exporter.data.clips import Clips
from facecode_exporter.errors import RunError
from facecode_exporter.nets.speech import family_of, n_frames
from facecode_exporter.nets.wav2vec2 import Wav2Vec2
from facecode_exporter.training.config import TrainingConfig
from facecode_exporter.training.streamed_rows import random_plan, streamed_rows, whole_seconds
from facecode_spec.schema import SystemSpec


class SpeechRows:
    """Speech features of the clips of each split; kept, as float16, where they never change."""

    def __init__(
        self,
        system: SystemSpec,
        encoder: nn.Module,
        splits: dict[str, Clips],
        config: TrainingConfig,
        trained: bool,
    ) -> None:
        """Freeze the encoder, or train all of it but what its family keeps frozen.

        Raises:
            RunError: the configuration asks of the encoder what its family does not do.
        """
        self.system, self.encoder, self.splits, self.trained = system, encoder, splits, trained
        disturbances = (config.mask_share, config.layer_drop, config.encoder_dropout)
        self._wav2vec2 = encoder if isinstance(encoder, Wav2Vec2) else None
        self._is_aligned = config.aligned_speech
        if self._wav2vec2 is not None:
            self._wav2vec2.disturb(*disturbances)
        elif any(disturbances) or config.aligned_speech:
            raise RunError(
                "mask_share, layer_drop, encoder_dropout and aligned_speech are of wav2vec 2.0; "
                f"{system.name} hears through {system.speech_encoder.family}"
            )
        encoder.requires_grad_(trained)
        for name, parameter in encoder.named_parameters():
            if name.startswith(family_of(system).frozen):
                parameter.requires_grad_(False)
        self.lengths = {split: self._frames(clips) for split, clips in splits.items()}
        self._kept: dict[tuple[str, int, bool], Tensor] = {}

    def batch(
        self, split: str, group: list[tuple[int, int, int]], streamed_share: float = 0.0
    ) -> Tensor:
        """Rows of the frames [start, start + n) of each (clip, start, n): (B, n * rows, width).

        A `streamed_share` of the clips of split `train` is heard as a stream hears it: the same
        ones in every run and epoch, so that each is encoded once.
        """
        rows = self.system.speech_encoder.memory_rows_per_frame
        share = streamed_share if split == "train" else 0.0
        heard = [(self._clip(split, i, _is_among(i, share)), start, n) for i, start, n in group]
        return torch.stack([clip[start * rows : (start + n) * rows] for clip, start, n in heard])

    def _clip(self, split: str, index: int, is_streamed: bool) -> Tensor:
        encode = self._encode_streamed if is_streamed else self._encode
        if self.trained:
            return encode(split, index)
        key = (split, index, is_streamed)
        if key not in self._kept:
            self.encoder.eval()
            with torch.no_grad():
                self._kept[key] = encode(split, index).half()
        return self._kept[key].float()

    def _encode(self, split: str, index: int) -> Tensor:
        audio = self.splits[split].audio(index)
        heard = normalise(audio) if self.system.speech_encoder.normalise else audio
        if self._wav2vec2 is None or not self._is_aligned:
            return self._rows(heard[None])[0]
        length = self.lengths[split][index]
        return self._wav2vec2.aligned(torch.from_numpy(heard)[None], length)[0]

    def _rows(self, audio: Float32) -> Tensor:
        speech: Tensor = self.encoder(torch.from_numpy(audio))
        return speech

    def _encode_streamed(self, split: str, index: int) -> Tensor:
        clips, spec = self.splits[split], self.system.speech_encoder
        before = whole_seconds(clips.audio(index - 1), spec.sample_rate)
        plan = random_plan(self.system.fps, spec.sample_rate, index)
        per_frame = spec.memory_rows_per_frame
        rows = streamed_rows(
            self._rows, clips.audio(index), before, plan, per_frame, spec.normalise
        )
        missing = self.lengths[split][index] * per_frame - len(rows)
        return rows if missing <= 0 else torch.cat([rows, rows[-per_frame:].repeat(missing, 1)])

    def _frames(self, clips: Clips) -> list[int]:
        """Frames that both the motion and the speech of each clip have, or are stretched to."""
        spec, fps = self.system.speech_encoder, self.system.fps
        if self._is_aligned and spec.frame_grid != "pairs":
            return [len(clips.offsets(i)) for i in range(len(clips.names))]
        return [
            min(len(clips.offsets(i)), n_frames(spec, fps, len(clips.audio(i))))
            for i in range(len(clips.names))
        ]


def _is_among(index: int, share: float) -> bool:
    """Whether a clip is one of a share that is drawn once and for all."""
    return bool(np.random.default_rng(index).random() < share)
