"""A pretrained speech encoder from a local Hugging Face folder, into a system's."""

from __future__ import annotations

from pathlib import Path

from torch import nn

from facecode_exporter.errors import CheckpointError
from facecode_exporter.nets.speech import Family


def load_pretrained(encoder: nn.Module, family: Family, folder: Path) -> None:
    """Copy the weights of the folder's model; nothing is downloaded.

    Raises:
        CheckpointError: no such model, or one of other sizes.
    """
    kind = family.hugging_face.model_type
    if not (folder / "config.json").is_file():
        raise CheckpointError(f"{folder} is no Hugging Face folder: it has no config.json")
    try:
        state = family.pretrained(folder)
    except Exception as error:  # transformers raises many kinds for a broken folder
        raise CheckpointError(f"{folder} holds no {kind} model: {error}") from error
    own = encoder.state_dict()
    wrong = [k for k in own if k != "masked_spec_embed" and (
        k not in state or state[k].shape != own[k].shape)]  # fmt: skip
    if wrong:
        raise CheckpointError(
            f"{folder} has another architecture than the system: {wrong[0]} and "
            f"{len(wrong) - 1} more; give its config.json as --speech-encoder-config"
        )
    encoder.load_state_dict({k: state[k] for k in own if k in state}, strict=False)
