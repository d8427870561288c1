"""What a trained system is, as frozen dataclasses.

Values compare equal when the systems are the same. Knows nothing of weights, graphs or files.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from facecode_spec.plain import SpecError

FrameGrid = Literal["interpolate", "pairs"]
Family = Literal["codetalker", "cdface", "faceformer"]
PartKind = Literal["codes", "offsets"]
UpAxis = Literal["x", "y", "z"]

LARGEST = 1_000_000
"""Of a width or count: no system comes near it, and memory for it can be had."""


@dataclass(frozen=True)
class SpeechEncoderSpec:
    """The network from a waveform to one memory row, or two, per frame."""

    family: Literal["wav2vec2", "whisper"]
    frame_grid: FrameGrid
    """`interpolate`: features resampled to the frame rate, one memory row a frame (VOCASET).
    `pairs`: two neighbouring features a frame, an odd last feature dropped (BIWI)."""
    feature_rate: float = 50.0
    """Features per second that the convolutions give."""
    sample_rate: int = 16_000
    normalise: bool = True
    """The waveform is brought to zero mean and unit variance over the whole clip."""
    min_samples: int = 720
    """The shortest audio that gives one frame."""
    architecture: Mapping[str, Any] = field(default_factory=dict)
    """Hugging Face configuration fields that differ from the family's defaults."""

    @property
    def memory_rows_per_frame(self) -> int:
        """Memory rows that the cross-attention of one frame sees."""
        return 2 if self.frame_grid == "pairs" else 1


def _check_sizes(spec: object, *sizes: int) -> None:
    if not all(1 <= size <= LARGEST for size in sizes):
        raise SpecError(f"got {spec}; expected sizes of 1 to {LARGEST:,}")


@dataclass(frozen=True)
class CodebookSpec:
    """The discrete motion prior: N codes of C numbers, H of them a frame."""

    n_codes: int
    codes_per_frame: int
    dim: int

    def __post_init__(self) -> None:
        _check_sizes(self, self.n_codes, self.codes_per_frame, self.dim)


@dataclass(frozen=True)
class CrossModalDecoderSpec:
    """The autoregressive transformer from speech memory and past motion to code features."""

    dim: int
    n_layers: int
    n_heads: int
    dim_feedforward: int
    period: int
    """Frames after which the position code repeats and the attention bias takes a step."""

    def __post_init__(self) -> None:
        _check_sizes(self, self.dim, self.n_layers, self.n_heads, self.dim_feedforward, self.period)


@dataclass(frozen=True)
class MotionDecoderSpec:
    """The decoder half of the VQ autoencoder, from code vectors to vertex offsets."""

    dim: int
    n_layers: int
    n_heads: int
    dim_feedforward: int
    negative_slope: float
    """Slope of the leaky ReLU for negative values."""
    norm_affine: bool = False
    input_projection: bool = False
    """A linear layer brings the H*C code numbers to `dim` (BIWI); else H*C equals `dim`."""
    output_bias: bool = True
    kernel: int = 5
    """Taps of the convolution, centred on the frame that they give."""

    def __post_init__(self) -> None:
        _check_sizes(self, self.dim, self.n_layers, self.n_heads, self.dim_feedforward)
        if not 0 <= self.negative_slope < 1:
            raise SpecError(f"got a negative slope of {self.negative_slope}; expected 0 to 1")


@dataclass(frozen=True)
class PartSpec:
    """One part of the face, animated by a decoder of its own."""

    name: str
    codebook: CodebookSpec | None
    """None: a part of kind `offsets`."""
    cross_modal_decoder: CrossModalDecoderSpec
    motion_decoder: MotionDecoderSpec | None
    """None: a part of kind `offsets`."""
    n_samples: int = 1
    """Heads of the cross-modal decoder: samples of this part for each sample of the parts before
    it (CDFace's K and M)."""
    conditions_on: tuple[str, ...] = ()
    """Earlier parts whose code vectors of the same frame the cross-modal decoder reads."""
    n_vertices: int | None = None
    """Vertices of the part's own; None: the whole face."""

    def __post_init__(self) -> None:
        if (self.codebook is None) != (self.motion_decoder is None):
            raise SpecError(
                f"part {self.name!r}: a codebook and a motion decoder go together; give both for "
                "a part that speaks in codes, or neither"
            )
        _check_heads(self.name, self.cross_modal_decoder)
        if self.kind == "codes":
            self._check_prior()
        elif self.n_samples != 1 or self.conditions_on:
            raise SpecError(
                f"part {self.name!r} of kind 'offsets' has {self.n_samples} samples and conditions "
                f"on {list(self.conditions_on)}; expected one sample, and no condition"
            )

    @property
    def kind(self) -> PartKind:
        """`codes`: the decoder predicts motion codes. `offsets`: it predicts motion itself."""
        return "offsets" if self.codebook is None else "codes"

    @property
    def prior(self) -> tuple[CodebookSpec, MotionDecoderSpec]:
        """The discrete motion prior of a part of kind `codes`.

        Raises:
            SpecError: a part of another kind.
        """
        if self.codebook is None or self.motion_decoder is None:
            raise SpecError(f"part {self.name!r} has no codebook; expected a part of kind 'codes'")
        return self.codebook, self.motion_decoder

    @property
    def hidden_dim(self) -> int:
        """E, the width of what the vertex head reads."""
        decoder = self.cross_modal_decoder if self.motion_decoder is None else self.motion_decoder
        return decoder.dim

    def _check_prior(self) -> None:
        codebook, decoder = self.prior
        code_width = codebook.codes_per_frame * codebook.dim
        if not decoder.input_projection and code_width != decoder.dim:
            raise SpecError(
                f"part {self.name!r}: {codebook.codes_per_frame} codes of {codebook.dim} numbers "
                f"make {code_width}, but the motion decoder is {decoder.dim} wide and has no "
                "input projection"
            )
        if decoder.kernel < 1 or decoder.kernel % 2 == 0:
            raise SpecError(
                f"part {self.name!r}: got a kernel of {decoder.kernel}; expected an odd number"
            )
        _check_heads(self.name, decoder)


def _check_heads(part: str, owner: CrossModalDecoderSpec | MotionDecoderSpec) -> None:
    if owner.dim % owner.n_heads:
        raise SpecError(
            f"part {part!r}: a width of {owner.dim} does not divide into {owner.n_heads} heads"
        )


@dataclass(frozen=True)
class SystemSpec:
    """A trained system: everything that is known of it before its weights."""

    name: str
    family: Family
    """Which network the parts make: how weights are named, trained and animated by torch."""
    reference: str
    """The publication that describes the system."""
    fps: float
    n_vertices: int
    unit: str
    """The unit of length, in words."""
    styles: tuple[str, ...]
    speech_encoder: SpeechEncoderSpec
    parts: tuple[PartSpec, ...]
    metres_per_unit: float | None = None
    """None: not known."""
    up_axis: UpAxis | None = None
    """None: not known."""

    def __post_init__(self) -> None:
        if not self.parts:
            raise SpecError(f"system {self.name!r} has no part")
        self._check_parts()
        if not self.styles or len(set(self.styles)) != len(self.styles):
            raise SpecError(f"system {self.name!r} needs styles with different names")

    def _check_parts(self) -> None:
        if self.family != "cdface" and len(self.parts) != 1:
            raise SpecError(
                f"system {self.name!r} has {len(self.parts)} parts; the family {self.family} has "
                "one"
            )
        kind = "offsets" if self.family == "faceformer" else "codes"
        if other := [part.name for part in self.parts if part.kind != kind]:
            raise SpecError(
                f"parts {other} of {self.name!r} are not of kind {kind!r}, as those of the family "
                f"{self.family} are"
            )
        names = [part.name for part in self.parts]
        if len(set(names)) != len(names):
            raise SpecError(f"system {self.name!r} has two parts of one name: {names}")
        for i, part in enumerate(self.parts):
            if unknown := set(part.conditions_on) - set(names[:i]):
                raise SpecError(
                    f"part {part.name!r} conditions on {sorted(unknown)}; expected parts before it"
                )
        covered = sum(part.n_vertices or self.n_vertices for part in self.parts)
        if covered != self.n_vertices:
            raise SpecError(
                f"the parts of {self.name!r} have {covered} vertices in all; expected "
                f"{self.n_vertices}"
            )

    def part(self, name: str) -> PartSpec:
        """The part of that name.

        Raises:
            KeyError
        """
        return {part.name: part for part in self.parts}[name]

    def vertices_of(self, part: PartSpec) -> int:
        """How many vertices `part` moves."""
        return self.n_vertices if part.n_vertices is None else part.n_vertices
