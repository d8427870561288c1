"""A pretrained wav2vec 2.0 from a local Hugging Face folder, into a system's speech encoder."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn
from transformers import Wav2Vec2Model

from facecode_exporter.errors import CheckpointError


def load_wav2vec2(encoder: nn.Module, folder: Path) -> None:
    """Copy the weights of the folder's model; nothing is downloaded.

    Raises:
        CheckpointError: no such model, or one of other sizes.
    """
    if not (folder / "config.json").is_file():
        raise CheckpointError(f"{folder} is no Hugging Face folder: it has no config.json")
    try:
        source = Wav2Vec2Model.from_pretrained(folder, local_files_only=True)
    except Exception as error:  # transformers raises many kinds for a broken folder
        raise CheckpointError(f"{folder} holds no wav2vec2 model: {error}") from error
    torch.nn.utils.parametrize.remove_parametrizations(source.encoder.pos_conv_embed.conv, "weight")
    state = source.state_dict()
    own = encoder.state_dict()
    wrong = [k for k in own if k != "masked_spec_embed" and (
        k not in state or state[k].shape != own[k].shape)]  # fmt: skip
    if wrong:
        raise CheckpointError(
            f"{folder} has another architecture than the system: {wrong[0]} and "
            f"{len(wrong) - 1} more; give its config.json as --wav2vec2-config"
        )
    encoder.load_state_dict({k: state[k] for k in own if k in state}, strict=False)
