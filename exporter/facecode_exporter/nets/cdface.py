"""CDFace (Gu et al. 2024): parts of the face one after the other, several samples of each.

One speech encoder is shared. Each part has a VQ motion prior and a query network of its own, that
of CodeTalker with K heads; a later part also reads the code vectors of the parts before it. Samples
ride on the batch axis: every row has its own past, and head `sample[b]` answers for row b.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias, cast

import torch
from torch import Tensor, nn

from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.nets.part import PartNet, Prediction
from facecode_exporter.nets.speech import speech_encoder
from facecode_exporter.nets.speech_decoder import Progress, no_bar
from facecode_spec.schema import SystemSpec


class CDFace(nn.Module):
    """The trained system, for any number of parts."""

    def __init__(self, system: SystemSpec) -> None:
        super().__init__()
        self.system = system
        self.audio_encoder = speech_encoder(system)
        self.parts = nn.ModuleDict({part.name: PartNet(system, part) for part in system.parts})

    @property
    def part_nets(self) -> tuple[PartNet, ...]:
        """The networks of the parts, in the order in which they run."""
        return tuple(cast(PartNet, net) for net in self.parts.values())

    def part_net(self, name: str) -> PartNet:
        """The network of one part."""
        return cast(PartNet, self.parts[name])


Trained: TypeAlias = CodeTalker | CDFace
"""A trained system of parts with codes: `system`, `audio_encoder`, `part_nets`."""


@torch.no_grad()
def predict_parts(
    part_nets: Sequence[PartNet],
    speech: Tensor,
    style: Tensor,
    samples: Mapping[str, Tensor] | None = None,
    held: Mapping[str, Tensor] | None = None,
    progress: Progress = no_bar,
) -> dict[str, Prediction]:
    """Animate every part of a batch of rows, by the plain algorithm.

    Args:
        part_nets: in the order in which they run.
        speech: output of the speech encoder (B, T * rows, width); repeat a clip to draw several
            samples of it.
        style: weights (B, n_styles).
        samples: by part, the head that answers for each row, (B,) int64; else the first.
        held: by part, codes (B, T, H) that stand in place of predicted ones.
        progress: wraps the steps of each part.
    """
    samples, held = samples or {}, held or {}
    results: dict[str, Prediction] = {}
    vectors: dict[str, Tensor] = {}
    for net in part_nets:
        name = net.part.name
        if name in held:
            results[name] = net.held(held[name])
        else:
            memory = net.audio_feature_map(speech)
            results[name] = net.animate(memory, style, samples.get(name), vectors, progress)
        vectors[name] = net.autoencoder.quantize.look_up(results[name].codes)
    return results
