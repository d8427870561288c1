"""The decoder step of a part without a codebook, as a graph."""

from __future__ import annotations

from torch import Tensor

from facecode_exporter.bundles.views import StepView, fuse
from facecode_exporter.nets.speech_decoder import SpeechDecoder


class OffsetsStepView(StepView):
    """The step of a part of kind `offsets`."""

    def __init__(self, net: SpeechDecoder) -> None:
        super().__init__(net)
        self.feed_back = fuse(net.vertice_map, net.output_layer)

    def predict(self, x: Tensor, sample: Tensor | None) -> tuple[Tensor, ...]:  # noqa: ARG002
        """The hidden frame (B, D), and what is fed back (B, D) before the next one."""
        return x[:, 0], self.feed_back(x[:, 0])
