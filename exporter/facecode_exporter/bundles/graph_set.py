"""Every graph of a system once, in the order in which graphs run: signature, file, entry, view.

The only enumeration of graphs: writing, the manifest, int8 and parity go through it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from torch import nn

from facecode.loop.engine import Engine
from facecode.session import Graph
from facecode_exporter.bundles.motion_view import MotionDecoderView
from facecode_exporter.bundles.offsets_view import OffsetsStepView
from facecode_exporter.bundles.speech_view import SpeechEncoderView
from facecode_exporter.bundles.views import DecoderStepView, VertexHeadView
from facecode_exporter.nets.networks import Network
from facecode_spec.entries import GraphEntry
from facecode_spec.graphs import (
    DECODER_STEP,
    MOTION_DECODER,
    SPEECH_ENCODER,
    VERTEX_HEAD,
    GraphSpec,
    part_file,
    part_graphs,
    speech_encoder,
)
from facecode_spec.schema import PartKind, PartSpec, SystemSpec

PART_VIEWS: dict[PartKind, dict[str, Callable[[Any], nn.Module]]] = {
    "codes": {
        DECODER_STEP: DecoderStepView,
        MOTION_DECODER: MotionDecoderView,
        VERTEX_HEAD: VertexHeadView,
    },
    "offsets": {DECODER_STEP: OffsetsStepView, VERTEX_HEAD: VertexHeadView},
}


@dataclass(frozen=True)
class SystemGraph:
    """One graph of a system."""

    spec: GraphSpec
    name: str
    """Of the file, without suffix."""
    part: PartSpec | None = None
    """None: the speech encoder, which all parts share."""

    @property
    def file(self) -> str:
        """Name of the file in the bundle."""
        return f"{self.name}.onnx"

    @property
    def entry(self) -> GraphEntry:
        """What the manifest says of the graph."""
        return GraphEntry.of(self.file, self.spec)

    def view(self, net: Network) -> nn.Module:
        """The module that computes the graph, with the weights of `net`."""
        if self.part is None:
            return SpeechEncoderView(net)
        (own,) = (part_net for part_net in net.part_nets if part_net.part.name == self.part.name)
        return PART_VIEWS[self.part.kind][self.spec.name](own)

    def loaded(self, engine: Engine) -> Graph:
        """The graph as the runtime has loaded it."""
        return {graph.name: graph for graph in engine.graphs}[self.name]


def graph_set(system: SystemSpec) -> tuple[SystemGraph, ...]:
    """All graphs of `system`."""
    return (
        SystemGraph(speech_encoder(system), SPEECH_ENCODER),
        *(
            SystemGraph(spec, part_file(system, part, spec.name), part)
            for part in system.parts
            for spec in part_graphs(system, part)
        ),
    )
