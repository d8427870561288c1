"""Public CodeTalker checkpoint files to networks and back.

A file holds `{"state_dict": {name: tensor}}`: stage 1 the VQ autoencoder, stage 2 the rest. A
system of several parts has such a pair for each part; all hold the same speech encoder. Weights are
read with `weights_only=True` and become float32. Knows nothing of graphs.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from facecode_exporter.errors import CheckpointError, SwappedCheckpointsError
from facecode_exporter.nets.cdface import Trained
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_exporter.nets.networks import network_of
from facecode_exporter.nets.part import PartNet
from facecode_exporter.nets.sinusoid import sinusoid
from facecode_exporter.nets.speech_decoder import SpeechDecoder
from facecode_exporter.nets.vq_autoencoder import VQAutoencoder
from facecode_exporter.state_files import State, fill, listed, read_state, save_state
from facecode_spec.schema import SystemSpec
from facecode_spec.systems import SYSTEMS

POSITIONS = "PPE.pe"
NOT_STAGE2 = ("autoencoder.", "audio_encoder.")
AUDIO = "audio_encoder."
CONV = f"{AUDIO}encoder.pos_conv_embed.conv"
WEIGHT_NORM_NAMES = (
    (f"{CONV}.weight_g", f"{CONV}.weight_v"),
    (f"{CONV}.parametrizations.weight.original0", f"{CONV}.parametrizations.weight.original1"),
)


def load_system(system: SystemSpec, stage1: Sequence[Path], stage2: Sequence[Path]) -> Trained:
    """The trained system in evaluation mode, from a pair of files for each of its parts.

    Raises:
        CheckpointNotFoundError: no such file.
        SwappedCheckpointsError: the two files were given the wrong way round.
        CheckpointError: another number of files than parts, not a checkpoint, keys and shapes that
            do not fit `system`, or parts with speech encoders of their own.
    """
    net = network_of(system)
    if isinstance(net, FaceFormer):
        raise CheckpointError(f"{system.name} is one file, not two stages; give --checkpoint FILE")
    if not len(stage1) == len(stage2) == len(system.parts):
        names = ", ".join(part.name for part in system.parts)
        raise CheckpointError(
            f"got {len(stage1)} files of stage 1 and {len(stage2)} of stage 2; {system.name} needs "
            f"one of each for: {names}"
        )
    problems: list[str] = []
    encoder: State = {}
    for part, first_file, second_file in zip(net.part_nets, stage1, stage2, strict=True):
        first, second = read_state(first_file), read_state(second_file)
        _refuse_swapped(first, second, first_file, second_file)
        fold_weight_norm(second)
        own_encoder = {k: second.pop(k) for k in list(second) if k.startswith(AUDIO)}
        _require_same(encoder, own_encoder, second_file)
        encoder = encoder or own_encoder
        problems += _fill_part(part, first, second, first_file, second_file)
    problems += fill(net.audio_encoder, encoder, f"stage 2, {stage2[0]}", prefix=AUDIO)
    if problems:
        raise CheckpointError(
            f"the checkpoints do not fit {system.name}, {listed(problems)}"
            + other_system_hint(system, first.get("decoder.vertice_map_reverse.weight"))
        )
    return net.eval()


def load_part(net: PartNet, stage1: Path, stage2: Path) -> None:
    """Fill one part from its files; the speech encoder in them is left aside.

    Raises:
        CheckpointNotFoundError, CheckpointError.
    """
    second = {k: v for k, v in read_state(stage2).items() if not k.startswith(AUDIO)}
    if problems := _fill_part(net, read_state(stage1), second, stage1, stage2):
        raise CheckpointError(listed(problems))


def load_encoder(encoder: nn.Module, stage2: Path) -> None:
    """Fill a speech encoder from a stage-2 file.

    Raises:
        CheckpointNotFoundError, CheckpointError.
    """
    state = read_state(stage2)
    fold_weight_norm(state)
    weights = {k: v for k, v in state.items() if k.startswith(AUDIO)}
    if problems := fill(encoder, weights, f"stage 2, {stage2}", prefix=AUDIO):
        raise CheckpointError(listed(problems))


def save_system(net: Trained, stage1: Sequence[Path], stage2: Sequence[Path]) -> None:
    """Write `net` as two files a part in the layout of the released checkpoints."""
    for part, first, second in zip(net.part_nets, stage1, stage2, strict=True):
        save_stage1(part.autoencoder, first)
        save_stage2(part, net.audio_encoder, second)


def save_stage2(part: PartNet, audio_encoder: nn.Module, stage2: Path) -> None:
    """Write everything but the autoencoder in the layout of the released stage-2 files."""
    second = {k: v.clone() for k, v in part.state_dict().items() if not k.startswith(NOT_STAGE2)}
    second |= {f"{AUDIO}{k}": v.clone() for k, v in audio_encoder.state_dict().items()}
    unfold_weight_norm(second)
    second[POSITIONS] = position_table(part)
    save_state({"state_dict": second}, stage2)


def save_stage1(autoencoder: VQAutoencoder, stage1: Path) -> None:
    """Write an autoencoder in the layout of the released stage-1 files."""
    state = {k: v.clone() for k, v in autoencoder.state_dict().items()}
    hidden = autoencoder.decoder.constant.shape[0]
    for side in ("encoder", "decoder"):
        state[f"{side}.{side}_pos_embedding.pe"] = sinusoid(5000, hidden)[:, None]
    save_state({"state_dict": state}, stage1)


def load_stage1(autoencoder: VQAutoencoder, stage1: Path) -> None:
    """Fill `autoencoder` from a stage-1 file.

    Raises:
        CheckpointNotFoundError, CheckpointError.
    """
    state = read_state(stage1)
    problems = _take_constants(autoencoder, state, f"stage 1, {stage1}")
    if problems := [*problems, *fill(autoencoder, state, f"stage 1, {stage1}")]:
        raise CheckpointError(listed(problems))


def _refuse_swapped(first: State, second: State, stage1: Path, stage2: Path) -> None:
    def is_stage1(state: State) -> bool:
        return "quantize.embedding.weight" in state

    def is_stage2(state: State) -> bool:
        return any(k.startswith("transformer_decoder.") for k in state)

    if is_stage2(first) and is_stage1(second):
        raise SwappedCheckpointsError(
            f"the files are swapped: {stage1} holds stage 2 and {stage2} holds stage 1. "
            "Exchange --stage1 and --stage2"
        )
    if is_stage2(first) and not is_stage1(first):
        raise CheckpointError(
            f"{stage1} is a stage-2 file; --stage1 needs the VQ autoencoder (quantize.*, decoder.*)"
        )
    if is_stage1(second) and not is_stage2(second):
        raise CheckpointError(
            f"{stage2} is a stage-1 file; --stage2 needs the speech-driven decoder "
            "(audio_encoder.*, transformer_decoder.*)"
        )


def unfold_weight_norm(state: State) -> None:
    """Undo `fold_weight_norm`, under the names of the released files."""
    if f"{CONV}.weight" in state:
        weight = state.pop(f"{CONV}.weight")
        state[f"{CONV}.weight_g"] = _norm_over_channels(weight)
        state[f"{CONV}.weight_v"] = weight


def _norm_over_channels(weight: Tensor) -> Tensor:
    """Norm of a (out, in, kernel) weight for each kernel position: (1, 1, kernel)."""
    return torch.sqrt(weight.square().sum(dim=(0, 1), keepdim=True))


def fold_weight_norm(state: State) -> None:
    """Put the weight of the positional convolution in place of its norm and direction."""
    for g_name, v_name in WEIGHT_NORM_NAMES:
        if g_name in state and v_name in state:
            g, v = state.pop(g_name), state.pop(v_name)
            if v.dim() == 3 and g.shape == (1, 1, v.shape[-1]):
                state[f"{CONV}.weight"] = v * (g / _norm_over_channels(v))
            else:
                state[g_name], state[v_name] = g, v  # reported as keys that do not fit


def _fill_part(net: PartNet, first: State, second: State, stage1: Path, stage2: Path) -> list[str]:
    """Fill a part from the states of its files; what does not fit comes back."""
    second = {k: v for k, v in second.items() if not k.startswith("autoencoder.")}
    return [
        *_take_constants(net.autoencoder, first, f"stage 1, {stage1}"),
        *take_position_table(net, second, f"stage 2, {stage2}"),
        *fill(net.autoencoder, first, f"stage 1, {stage1}"),
        *fill(net, second, f"stage 2, {stage2}", skip=NOT_STAGE2),
    ]


def _require_same(encoder: State, other: State, file: Path) -> None:
    """Refuse a part that was trained with another speech encoder than the first one."""
    same = encoder.keys() == other.keys() and all(torch.equal(encoder[k], other[k]) for k in other)
    if encoder and other and not same:
        raise CheckpointError(
            f"{file} holds another speech encoder than the part before; all parts share one. Train "
            "it with --earlier, which takes the encoder over"
        )


def position_table(net: SpeechDecoder) -> Tensor:
    """The position code as released files carry it, repeated over 600 frames and a bit."""
    return net.position_code.repeat(600 // len(net.position_code) + 1, 1)[None]


def take_position_table(net: SpeechDecoder, state: State, origin: str) -> list[str]:
    """Use the position code that a file carries, if it carries one; what does not fit is told."""
    return _take_rows(net.position_code, state, POSITIONS, origin)


def _take_constants(autoencoder: VQAutoencoder, state: State, origin: str) -> list[str]:
    """Row 0 of the position tables that a file carries, which is what every frame gets."""
    problems = []
    for side, trunk in (("encoder", autoencoder.encoder), ("decoder", autoencoder.decoder)):
        name = f"{side}.{side}_pos_embedding.pe"
        problems += _take_rows(trunk.constant[None], state, name, origin)
    return problems


def _take_rows(wanted: Tensor, state: State, name: str, origin: str) -> list[str]:
    """Take `name` out of a state, and its first rows into `wanted` (n, dim)."""
    table = state.pop(name, None)
    if table is None:
        return []
    n, dim = wanted.shape
    if table.dim() == 0 or table.shape[-1] != dim or table.numel() < n * dim:
        return [f"{origin}: {name} is {tuple(table.shape)}, expected {n} rows or more of {dim}"]
    rows = table.reshape(-1, dim)[:n]
    if not torch.isfinite(rows).all():
        return [f"{origin}: {name} holds NaN or infinite values"]
    wanted.copy_(rows)
    return []


def other_system_hint(system: SystemSpec, output_weight: Tensor | None) -> str:
    """Which system of the family has the vertices of a file's output layer (3V, E)."""
    for name, other in SYSTEMS.items():
        fits = output_weight is not None and output_weight.shape[:1] == (3 * other.n_vertices,)
        if fits and other.family == system.family and other.n_vertices != system.n_vertices:
            return f"\n  The number of vertices fits --system {name}"
    return ""
