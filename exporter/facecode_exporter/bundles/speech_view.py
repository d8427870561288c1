"""The speech encoder as a graph: a waveform to what the cross-attention of every part reads."""

from __future__ import annotations

from torch import Tensor, nn

from facecode_exporter.bundles.views import fuse, key_and_value, rows, stack
from facecode_exporter.nets.networks import Network
from facecode_exporter.nets.speech import family_of
from facecode_exporter.nets.speech_decoder import SpeechDecoder


class SpeechEncoderView(nn.Module):
    """audio -> what the cross-attention of every part and layer reads, frame by frame."""

    def __init__(self, net: Network) -> None:
        super().__init__()
        self.audio_encoder = family_of(net.system).for_export(net.audio_encoder)
        self.memories = nn.ModuleList([CrossMemory(part) for part in net.part_nets])

    def forward(self, audio: Tensor) -> tuple[Tensor, ...]:
        """(B, n_samples) to each part's cross_output, or its cross_keys and cross_values."""
        speech = self.audio_encoder(audio)
        return tuple(rows for memory in self.memories for rows in memory(speech))


class CrossMemory(nn.Module):
    """Speech features -> what the cross-attention of one part reads."""

    def __init__(self, net: SpeechDecoder) -> None:
        super().__init__()
        self.to_memory = net.audio_feature_map
        self.n_rows = net.system.speech_encoder.memory_rows_per_frame
        self.n_layers = net.part.cross_modal_decoder.n_layers
        attentions = [layer.multihead_attn for layer in net.transformer_decoder.layers]
        if self.n_rows == 1:
            # One visible key: softmax is 1 and the attention is out_proj(v_proj(memory)).
            self.maps = nn.ModuleList([stack([fuse(a.out_proj, rows(a, 2)) for a in attentions])])
        else:
            kinds = zip(*(key_and_value(a) for a in attentions), strict=True)
            self.maps = nn.ModuleList([stack(list(kind)) for kind in kinds])

    def forward(self, speech: Tensor) -> tuple[Tensor, ...]:
        """(B, T * rows, width) to cross_output, or to cross_keys and cross_values."""
        memory = self.to_memory(speech)
        outputs = [m(memory).unflatten(-1, (self.n_layers, -1)) for m in self.maps]
        if self.n_rows == 1:
            return tuple(outputs)
        return tuple(o.unflatten(1, (-1, self.n_rows)).transpose(2, 3) for o in outputs)
