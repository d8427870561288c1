"""The graphs of a bundle: what each is called, takes, gives, and how exact it must be.

Axes are named; a number is a fixed size. `batch` holds clips, or samples of one clip.
The same tensor names stand in the torch views, in the graph files and in the runtime.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

from facecode_spec.schema import PartSpec, SystemSpec

OPSET = 20
"""First opset in which Gelu (also its tanh form) is one operator; onnxruntime has had it since
1.17. Later opsets add nothing that these graphs use."""

SPEECH_ENCODER = "speech_encoder"
DECODER_STEP = "decoder_step"
MOTION_DECODER = "motion_decoder"
VERTEX_HEAD = "vertex_head"

Axis: TypeAlias = str | int


@dataclass(frozen=True)
class TensorSpec:
    """One input or output of a graph."""

    name: str
    dtype: str
    axes: tuple[Axis, ...]
    """A name for an axis of any size, a number for a fixed one."""


@dataclass(frozen=True)
class Tolerance:
    """Largest absolute difference to the torch network that is float32 noise, and why."""

    atol: float
    reason: str


@dataclass(frozen=True)
class GraphSpec:
    """The signature of one graph."""

    name: str
    inputs: tuple[TensorSpec, ...]
    outputs: tuple[TensorSpec, ...]
    tolerance: Tolerance


VERTICES = Tolerance(
    1e-4, "the public code in float32 and float64 differs by 4e-6 (5e-6 at 809 frames)"
)
"""For whole clips, in the unit of the system. Codes have no tolerance: they are equal."""


def past_keys(layer: int) -> str:
    """Name of the input with the past keys of one self-attention layer."""
    return f"past_keys_{layer}"


def past_values(layer: int) -> str:
    """Name of the input with the past values of one self-attention layer."""
    return f"past_values_{layer}"


def condition_name(part: str) -> str:
    """Name of the input with the code vectors of an earlier part."""
    return f"condition_{part}"


def part_file(system: SystemSpec, part: PartSpec, name: str) -> str:
    """Name of a part's file or tensor: `name`, and the part's where there are several."""
    return name if len(system.parts) == 1 else f"{name}_{part.name}"


def _cross_memory(part: PartSpec, system: SystemSpec, frames: tuple[Axis, ...]) -> list[TensorSpec]:
    """What the cross-attention of `part` reads of the speech, per frame and layer.

    One visible key makes the softmax 1, so the attention's output itself is precomputed;
    several visible keys need keys and values.
    """
    decoder = part.cross_modal_decoder
    rows = system.speech_encoder.memory_rows_per_frame
    head = ("batch", *frames, decoder.n_layers)
    if rows == 1:
        name = part_file(system, part, "cross_output")
        return [TensorSpec(name, "float32", (*head, decoder.dim))]
    return [
        TensorSpec(part_file(system, part, name), "float32", (*head, rows, decoder.dim))
        for name in ("cross_keys", "cross_values")
    ]


def speech_encoder(system: SystemSpec) -> GraphSpec:
    """Waveform to cross-attention memory, once per utterance."""
    memory = [m for part in system.parts for m in _cross_memory(part, system, ("n_frames",))]
    return GraphSpec(
        SPEECH_ENCODER,
        (TensorSpec("audio", "float32", ("batch", "n_samples")),),
        tuple(memory),
        Tolerance(2e-4, "sums of up to 3072 products in another order; 2e-5 seen on values near 4"),
    )


def decoder_step(system: SystemSpec, part: PartSpec) -> GraphSpec:
    """One frame of the cross-modal decoder: state in, its prediction and the new K/V rows out.

    A part of kind `codes` predicts features. One of kind `offsets` predicts the hidden frame that
    its vertex head reads, and as `feedback` the `motion` of the next step.

    The past is a ring of slots: frame t stands in slot t mod n_slots, those from `step` on are
    empty and left out. A past without empty slots is one of n_slots = step.
    """
    decoder = part.cross_modal_decoder
    past = ("batch", decoder.n_heads, "n_slots", decoder.dim // decoder.n_heads)
    new_rows = (decoder.n_layers, "batch", decoder.dim)
    return GraphSpec(
        DECODER_STEP,
        (
            TensorSpec("motion", "float32", ("batch", decoder.dim)),
            TensorSpec("style", "float32", ("batch", len(system.styles))),
            TensorSpec("step", "int64", ()),
            *_sample(part),
            *(_condition(system.part(name)) for name in part.conditions_on),
            *_cross_memory(part, system, ()),
            *(TensorSpec(past_keys(i), "float32", past) for i in range(decoder.n_layers)),
            *(TensorSpec(past_values(i), "float32", past) for i in range(decoder.n_layers)),
        ),
        (
            *_predicted(part),
            TensorSpec("keys", "float32", new_rows),
            TensorSpec("values", "float32", new_rows),
        ),
        Tolerance(2e-4, "twelve layers of float32 sums in another order; 1e-5 seen"),
    )


def _predicted(part: PartSpec) -> list[TensorSpec]:
    """What the decoder step says of a frame."""
    if part.codebook is None:
        axes = ("batch", part.cross_modal_decoder.dim)
        return [TensorSpec(name, "float32", axes) for name in ("hidden", "feedback")]
    codes = ("batch", part.codebook.codes_per_frame, part.codebook.dim)
    return [TensorSpec("features", "float32", codes)]


def _sample(part: PartSpec) -> list[TensorSpec]:
    """Which head answers for each row, where there are several."""
    return [TensorSpec("sample", "int64", ("batch",))] if part.n_samples > 1 else []


def _condition(part: PartSpec) -> TensorSpec:
    codebook, _ = part.prior
    axes = ("batch", codebook.codes_per_frame, codebook.dim)
    return TensorSpec(condition_name(part.name), "float32", axes)


def motion_decoder(part: PartSpec) -> GraphSpec:
    """Quantise and decode a clip or prefix, or the last frames of it over a kept past.

    The frames that are decoded are, in this order: `revisited` ones, whose convolution is known
    and which `count`, `mean` and `squares` include; `known` ones, whose convolution is known; and
    those of `features`. Only the frames named by `frames` come out.
    """
    codebook, spec = part.prior
    vector = (codebook.codes_per_frame, codebook.dim)
    past = ("batch", spec.n_heads, "n_past", spec.dim // spec.n_heads)
    kept = (spec.n_layers, "batch", spec.n_heads, "n_kept", spec.dim // spec.n_heads)
    return GraphSpec(
        MOTION_DECODER,
        (
            TensorSpec("features", "float32", ("batch", "n_new", *vector)),
            TensorSpec("context", "float32", ("batch", "n_context", *vector)),
            TensorSpec("known", "float32", ("batch", "n_known", spec.dim)),
            TensorSpec("revisited", "float32", ("batch", "n_revisited", spec.dim)),
            TensorSpec("frames", "int64", ("n_shown",)),
            TensorSpec("count", "float32", ()),
            TensorSpec("mean", "float32", ("batch", spec.dim)),
            TensorSpec("squares", "float32", ("batch", spec.dim)),
            TensorSpec("past_log_weights", "float32", ("n_past",)),
            TensorSpec("revisited_log_weights", "float32", ("n_revisited",)),
            *(TensorSpec(past_keys(i), "float32", past) for i in range(spec.n_layers)),
            *(TensorSpec(past_values(i), "float32", past) for i in range(spec.n_layers)),
        ),
        (
            TensorSpec("codes", "int64", ("batch", "n_new", codebook.codes_per_frame)),
            TensorSpec("hidden", "float32", ("batch", "n_shown", spec.dim)),
            TensorSpec("feedback", "float32", ("batch", part.cross_modal_decoder.dim)),
            TensorSpec("activations", "float32", ("batch", "n_new", spec.dim)),
            TensorSpec("keys", "float32", kept),
            TensorSpec("values", "float32", kept),
        ),
        Tolerance(2e-4, "instance norm over few frames magnifies float32 noise; 2e-5 seen"),
    )


def vertex_head(system: SystemSpec, part: PartSpec) -> GraphSpec:
    """Hidden frames to vertex offsets, for the frames that are shown."""
    return GraphSpec(
        VERTEX_HEAD,
        (TensorSpec("hidden", "float32", ("batch", "n_shown", part.hidden_dim)),),
        (TensorSpec("offsets", "float32", ("batch", "n_shown", system.vertices_of(part), 3)),),
        Tolerance(1e-4, "one product over the hidden width in another order; 1e-6 seen"),
    )


def part_graphs(system: SystemSpec, part: PartSpec) -> tuple[GraphSpec, ...]:
    """The graphs that belong to one part of the face, in the order in which they run."""
    step, head = decoder_step(system, part), vertex_head(system, part)
    return (step, head) if part.kind == "offsets" else (step, motion_decoder(part), head)
