"""The runtime against the torch networks: graph by graph, and whole clips through the loop.

Graphs are compared with the views on random input at sizes that the export did not see. Clips
are compared with the public algorithm (`animate` of a network), which shares no fast path with
them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import torch
from torch import Tensor, nn

from facecode.arrays import AnyArray, Audio, Codes, Float32
from facecode.level import normalise
from facecode.loop.engine import Engine
from facecode.session import Graph
from facecode_exporter.errors import ParityError
from facecode_exporter.nets.cdface import predict_parts
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_exporter.nets.networks import Network
from facecode_exporter.nets.part import PartNet, Prediction
from facecode_exporter.nets.vq_autoencoder import Quantizer
from facecode_spec.graphs import VERTICES, GraphSpec, TensorSpec
from facecode_spec.manifest import ParityCase, ParityReport

Steps = Callable[[Iterable[int]], Iterable[int]]
GRAPH_SIZES: tuple[dict[str, int], ...] = (
    {"batch": 1, "n_samples": 1360, "n_past": 0, "n_shown": 1, "n_slots": 0, "step": 0}
    | {"n_new": 1, "n_context": 0, "n_known": 0, "n_revisited": 0},
    {"batch": 4, "n_samples": 2000, "n_past": 0, "n_shown": 3, "n_slots": 64, "step": 3}
    | {"n_new": 3, "n_context": 2, "n_known": 2, "n_revisited": 0},
    {"batch": 3, "n_samples": 9077, "n_past": 1, "n_shown": 2, "n_slots": 1, "step": 1}
    | {"n_new": 2, "n_context": 0, "n_known": 1, "n_revisited": 1},
    {"batch": 2, "n_samples": 23456, "n_past": 67, "n_shown": 5, "n_slots": 67, "step": 200}
    | {"n_new": 19, "n_context": 2, "n_known": 3, "n_revisited": 4},
)


@dataclass(frozen=True)
class Case:
    """One clip to compare: audio at the system's rate and style weights."""

    audio: Audio
    weights: Float32
    samples: Mapping[str, int] = field(default_factory=dict)
    """of each part, for each sample of the part before; 1 where none are named"""
    hold: Mapping[str, Codes] = field(default_factory=dict)
    """codes (T, H) of parts that are kept"""


def compare_graphs(
    pairs: Sequence[tuple[GraphSpec, nn.Module, Graph]], seed: int = 0
) -> dict[str, float]:
    """Largest absolute difference per graph output; codes count as equal or not.

    Raises:
        ParityError: a difference beyond the graph's tolerance.
    """
    rng = np.random.default_rng(seed)
    errors: dict[str, float] = {}
    for spec, view, graph in pairs:
        for sizes in GRAPH_SIZES:
            inputs = {t.name: _random_input(t, sizes, rng) for t in spec.inputs}
            with torch.no_grad():
                expected = view(*(torch.from_numpy(np.asarray(v)) for v in inputs.values()))
            expected = (expected,) if isinstance(expected, Tensor) else expected
            names = [t.name for t in spec.outputs]
            for name, want, got in zip(names, expected, graph.run(names, **inputs), strict=True):
                key, error = f"{spec.name}.{name}", _max_difference(want.numpy(), got)
                errors[key] = max(errors.get(key, 0.0), error)
                if not error <= spec.tolerance.atol:
                    raise ParityError(
                        f"{key} differs from torch by {error:.2e} at {sizes}; at most "
                        f"{spec.tolerance.atol:.0e} is float32 noise ({spec.tolerance.reason})"
                    )
    return errors


def compare_clip(
    net: Network, engine: Engine, case: Case, steps: Steps = lambda s: s
) -> ParityCase:
    """Animate one clip in `exact` mode by torch and by the runtime, every sample of it."""
    truth = _predict(net, case, steps)
    request = engine.request(case.weights, samples=case.samples, hold=case.hold)
    codes, offsets = engine.animate(case.audio, request)
    want = np.concatenate([p.codes.numpy() for p in truth.values()], axis=-1)
    if codes.shape != want.shape:
        raise ParityError(f"torch gives codes {want.shape}, the runtime {codes.shape}")
    expected = np.empty_like(offsets)
    for part in engine.parts:
        own = slice(None) if part.vertices is None else part.vertices
        expected[:, :, own] = truth[part.name].offsets.numpy()
    margins = [
        min_code_margin(truth[p.part.name], p.autoencoder.quantize)
        for p in net.part_nets
        if isinstance(p, PartNet) and p.part.name not in case.hold
    ]
    return ParityCase(
        n_frames=codes.shape[1],
        n_codes=codes.size,
        n_codes_equal=int((codes == want).sum()),
        max_vertex_error=_max_difference(expected, offsets),
        min_code_margin=min(margins, default=None),
    )


def _predict(net: Network, case: Case, steps: Steps) -> dict[str, Prediction]:
    """By torch, a row for each face: samples of the last part next to each other."""
    spec = net.system.speech_encoder
    waveform = normalise(case.audio) if spec.normalise else case.audio
    names = [part.name for part in net.system.parts]
    if isinstance(net, FaceFormer):
        style = torch.from_numpy(case.weights)[None]
        return {names[0]: net.predict(torch.from_numpy(waveform)[None], style, steps)}
    faces = np.array(list(product(*(range(case.samples.get(n, 1)) for n in names))))
    with torch.no_grad():
        speech = net.audio_encoder(torch.from_numpy(waveform)[None]).expand(len(faces), -1, -1)
    heads = {name: torch.from_numpy(faces[:, i]) for i, name in enumerate(names)}
    held = {n: torch.from_numpy(c).expand(len(faces), -1, -1) for n, c in case.hold.items()}
    style = torch.from_numpy(case.weights).expand(len(faces), -1)
    return predict_parts(net.part_nets, speech, style, heads, held, steps)


def require_parity(cases: Iterable[ParityCase]) -> None:
    """Refuse cases with an unequal code or a vertex beyond the tolerance.

    Raises:
        ParityError: with the numbers of every case.
    """
    cases = tuple(cases)
    failed = [
        c for c in cases if c.n_codes_equal != c.n_codes or not c.max_vertex_error <= VERTICES.atol
    ]
    if failed:
        lines = "\n  ".join(describe_case(c) for c in cases)
        raise ParityError(
            f"the bundle does not compute what the network computes ({len(failed)} of "
            f"{len(cases)} clips; expected all codes equal, vertices within {VERTICES.atol:g}):"
            f"\n  {lines}"
        )


def describe_case(case: ParityCase) -> str:
    """One clip's comparison in a line."""
    vertices = f"vertices within {case.max_vertex_error:.1e}"
    if case.min_code_margin is None:
        return f"{case.n_frames} frames: {vertices}"
    return (
        f"{case.n_frames} frames: {case.n_codes_equal} of {case.n_codes} codes equal, {vertices}, "
        f"smallest code margin {case.min_code_margin:.1e}"
    )


def min_code_margin(truth: Prediction, quantizer: Quantizer) -> float:
    """Smallest relative gap between nearest and second-nearest code: how far noise may reach."""
    rows = quantizer.embedding.weight.double()
    distance = torch.cdist(truth.features.double().flatten(0, -2), rows).square()
    nearest, second = distance.detach().topk(2, largest=False).values.unbind(-1)
    return float(((second - nearest) / second.clamp_min(1e-30)).min())


def report(graph_errors: dict[str, float], cases: Iterable[ParityCase]) -> ParityReport:
    """What goes into the manifest."""
    return ParityReport(VERTICES.atol, graph_errors, tuple(cases))


def _random_input(tensor: TensorSpec, sizes: dict[str, int], rng: np.random.Generator) -> AnyArray:
    shape = tuple(sizes[a] if isinstance(a, str) else a for a in tensor.axes)
    if tensor.name == "step":
        return np.array(sizes["step"])
    if tensor.name == "sample":  # an input where there are two heads or more
        return rng.integers(0, 2, shape)
    if tensor.name == "frames":
        n_decoded = sizes["n_new"] + sizes["n_known"] + sizes["n_revisited"]
        return np.sort(rng.choice(n_decoded, size=shape, replace=False))
    if tensor.name == "count":
        return np.array(rng.integers(100), dtype=np.float32)
    if tensor.name == "squares":
        return rng.uniform(50, 100, shape).astype(np.float32)
    return rng.standard_normal(shape, dtype=np.float32)


def _max_difference(want: AnyArray, got: AnyArray) -> float:
    if want.shape != got.shape:
        return float("inf")
    return float(np.abs(want - got).max()) if want.size else 0.0
