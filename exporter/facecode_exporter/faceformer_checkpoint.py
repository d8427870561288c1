"""Public FaceFormer checkpoint files to networks and back: one bare state dict with everything."""

from __future__ import annotations

from pathlib import Path

from facecode_exporter.checkpoints import (
    POSITIONS,
    fold_weight_norm,
    other_system_hint,
    position_table,
    take_position_table,
    unfold_weight_norm,
)
from facecode_exporter.errors import CheckpointError
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_exporter.state_files import fill, listed, read_state, save_state
from facecode_spec.schema import SystemSpec


def load_faceformer(system: SystemSpec, checkpoint: Path) -> FaceFormer:
    """The trained system in evaluation mode.

    Raises:
        CheckpointNotFoundError: no such file.
        CheckpointError: not a checkpoint, a file of another system, or keys and shapes that do not
            fit `system`.
    """
    state = read_state(checkpoint)
    if "vertice_map_r.weight" not in state:
        raise CheckpointError(
            f"{checkpoint} is no FaceFormer file: it has no vertice_map_r. Files of CodeTalker go "
            "with --stage1 and --stage2"
        )
    net = FaceFormer(system)
    fold_weight_norm(state)
    problems = take_position_table(net, state, str(checkpoint))
    if problems := [*problems, *fill(net, state, str(checkpoint))]:
        raise CheckpointError(
            f"the checkpoint does not fit {system.name}, {listed(problems)}"
            + other_system_hint(system, state["vertice_map_r.weight"])
        )
    return net.eval()


def save_faceformer(net: FaceFormer, checkpoint: Path) -> None:
    """Write `net` in the layout of the released files."""
    state = {name: value.clone() for name, value in net.state_dict().items()}
    unfold_weight_norm(state)
    state[POSITIONS] = position_table(net)
    save_state(state, checkpoint)
