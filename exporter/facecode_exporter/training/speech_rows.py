"""The frozen or trained speech encoder's output, cut to the frames that a batch sees."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from facecode.level import normalise
from facecode_exporter.data.clips import Clips
from facecode_exporter.nets.speech import family_of, n_frames
from facecode_spec.schema import SystemSpec


class SpeechRows:
    """Speech features of the clips of each split; kept, as float16, where they never change."""

    def __init__(
        self, system: SystemSpec, encoder: nn.Module, splits: dict[str, Clips], trained: bool
    ) -> None:
        """Freeze the encoder, or train all of it but what its family keeps frozen."""
        self.system, self.encoder, self.splits, self.trained = system, encoder, splits, trained
        encoder.requires_grad_(trained)
        for name, parameter in encoder.named_parameters():
            if name.startswith(family_of(system).frozen):
                parameter.requires_grad_(False)
        self.lengths = {split: self._frames(clips) for split, clips in splits.items()}
        self._kept: dict[tuple[str, int], Tensor] = {}

    def batch(self, split: str, group: list[tuple[int, int, int]]) -> Tensor:
        """Rows of the frames [start, start + n) of each (clip, start, n): (B, n * rows, width)."""
        rows = self.system.speech_encoder.memory_rows_per_frame
        return torch.stack(
            [self._clip(split, i)[start * rows : (start + n) * rows] for i, start, n in group]
        )

    def _clip(self, split: str, index: int) -> Tensor:
        if self.trained:
            return self._encode(split, index)
        if (split, index) not in self._kept:
            self.encoder.eval()
            with torch.no_grad():
                self._kept[split, index] = self._encode(split, index).half()
        return self._kept[split, index].float()

    def _encode(self, split: str, index: int) -> Tensor:
        audio = self.splits[split].audio(index)
        if self.system.speech_encoder.normalise:
            audio = normalise(audio)
        speech: Tensor = self.encoder(torch.from_numpy(audio)[None])[0]
        return speech

    def _frames(self, clips: Clips) -> list[int]:
        """Frames that both the motion and the speech of each clip have."""
        spec, fps = self.system.speech_encoder, self.system.fps
        return [
            min(len(clips.offsets(i)), n_frames(spec, fps, len(clips.audio(i))))
            for i in range(len(clips.names))
        ]
