"""What a trained system is, as frozen dataclasses, and their strict reading from plain data.

Comes in: keyword arguments, or the dictionaries of a JSON file. Goes out: values that compare
equal when the systems are the same. Knows nothing of weights, graphs or files.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

T = TypeVar("T")
FrameGrid = Literal["interpolate", "pairs"]


class SpecError(ValueError):
    """A spec or manifest does not have the form that this version of facecode reads."""


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


@dataclass(frozen=True)
class CodebookSpec:
    """The discrete motion prior: N codes of C numbers, H of them a frame."""

    n_codes: int
    codes_per_frame: int
    dim: int


@dataclass(frozen=True)
class CrossModalDecoderSpec:
    """The autoregressive transformer from speech memory and past motion to code features."""

    dim: int
    n_layers: int
    n_heads: int
    dim_feedforward: int
    period: int
    """Frames after which the position code repeats and the attention bias takes a step."""


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


@dataclass(frozen=True)
class PartSpec:
    """One part of the face with a codebook of its own."""

    name: str
    codebook: CodebookSpec
    cross_modal_decoder: CrossModalDecoderSpec
    motion_decoder: MotionDecoderSpec
    n_samples: int = 1
    """Heads of the cross-modal decoder: samples of this part for each sample of the parts before
    it (CDFace's K and M)."""
    conditions_on: tuple[str, ...] = ()
    """Earlier parts whose code vectors of the same frame the cross-modal decoder reads."""
    n_vertices: int | None = None
    """Vertices of the part's own; None: the whole face."""

    def __post_init__(self) -> None:
        code_width = self.codebook.codes_per_frame * self.codebook.dim
        if not self.motion_decoder.input_projection and code_width != self.motion_decoder.dim:
            raise SpecError(
                f"part {self.name!r}: {self.codebook.codes_per_frame} codes of "
                f"{self.codebook.dim} numbers make {code_width}, but the motion decoder is "
                f"{self.motion_decoder.dim} wide and has no input projection"
            )
        for owner in (self.cross_modal_decoder, self.motion_decoder):
            if owner.dim % owner.n_heads:
                raise SpecError(
                    f"part {self.name!r}: a width of {owner.dim} does not divide into "
                    f"{owner.n_heads} heads"
                )


@dataclass(frozen=True)
class SystemSpec:
    """A trained system: everything that is known of it before its weights."""

    name: str
    reference: str
    """The publication that describes the system."""
    fps: float
    n_vertices: int
    unit: str
    styles: tuple[str, ...]
    speech_encoder: SpeechEncoderSpec
    parts: tuple[PartSpec, ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise SpecError(f"system {self.name!r} has no part")
        self._check_parts()
        if not self.styles or len(set(self.styles)) != len(self.styles):
            raise SpecError(f"system {self.name!r} needs styles with different names")

    def _check_parts(self) -> None:
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


def to_plain(value: Any) -> Any:  # noqa: ANN401
    """Dataclasses and tuples as dictionaries and lists, ready for JSON."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: to_plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [to_plain(item) for item in value]
    return value


def from_plain(cls: type[T], data: object, where: str = "") -> T:
    """Build dataclass `cls` from plain data; an unknown, missing or mistyped key is an error.

    Raises:
        SpecError: with the dotted path of the offending key.
    """
    where = where or cls.__name__
    if not isinstance(data, Mapping):
        raise SpecError(f"{where}: expected an object, got {type(data).__name__}")
    hints = typing.get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls)}  # type: ignore[arg-type]
    if unknown := sorted(set(data) - set(fields)):
        raise SpecError(f"{where}: unknown key {', '.join(unknown)}; known: {', '.join(fields)}")
    required = {n for n, f in fields.items() if _has_no_default(f)}
    if missing := sorted(required - set(data)):
        raise SpecError(f"{where}: missing key {', '.join(missing)}")
    values = {name: _convert(hints[name], item, f"{where}.{name}") for name, item in data.items()}
    return cls(**values)


def _has_no_default(f: dataclasses.Field[Any]) -> bool:
    return f.default is dataclasses.MISSING and f.default_factory is dataclasses.MISSING


def _convert(hint: Any, value: Any, where: str) -> Any:  # noqa: ANN401
    """`value` as the type that the annotation `hint` names."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if hint is Any:
        return value
    if origin is types.UnionType or origin is typing.Union:
        options = [a for a in args if a is not type(None)]
        return None if value is None else _convert(options[0], value, where)
    if origin is Literal:
        if value not in args:
            raise SpecError(f"{where}: got {value!r}, expected one of {', '.join(map(repr, args))}")
        return value
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return from_plain(hint, value, where)
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise SpecError(f"{where}: expected a list, got {type(value).__name__}")
        return tuple(_convert(args[0], item, f"{where}[{i}]") for i, item in enumerate(value))
    if origin is not None and issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            raise SpecError(f"{where}: expected an object, got {type(value).__name__}")
        return {str(k): _convert(args[1], item, f"{where}.{k}") for k, item in value.items()}
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, hint) or (isinstance(value, bool) and hint is not bool):
        raise SpecError(f"{where}: expected {hint.__name__}, got {value!r}")
    return value
