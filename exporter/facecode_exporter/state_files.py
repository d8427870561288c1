"""State dicts: read from files, and copied into modules with all that does not fit named."""

from __future__ import annotations

import pickle
import re
from collections.abc import Mapping
from pathlib import Path
from zipfile import BadZipFile

import torch
from torch import Tensor, nn

from facecode_exporter.errors import CheckpointError, CheckpointNotFoundError

State = dict[str, Tensor]

OPTIONAL = {"audio_encoder.masked_spec_embed"}
MAX_PROBLEMS_SHOWN = 12


def read_state(path: Path) -> State:
    """The state dict of a checkpoint file, names without `module.`, values float32.

    Raises:
        CheckpointNotFoundError: no such file.
        CheckpointError: not a file of tensors.
    """
    if not path.is_file():
        raise CheckpointNotFoundError(f"no checkpoint file at {path}")
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, BadZipFile, ValueError, KeyError) as e:
        reason = str(e).strip().splitlines()[0] if str(e).strip() else type(e).__name__
        raise CheckpointError(f"{path} is not a PyTorch checkpoint of tensors: {reason}") from e
    state = content.get("state_dict", content) if isinstance(content, Mapping) else None
    if not isinstance(state, Mapping) or not state:
        raise CheckpointError(f"{path} holds no 'state_dict' with tensors")
    odd = [k for k, v in state.items() if not isinstance(v, Tensor) or not v.is_floating_point()]
    if odd:
        raise CheckpointError(f"{path}: expected floating-point tensors; {odd[0]!r} is none")
    return {re.sub(r"^(module\.)+", "", str(k)): v.float() for k, v in state.items()}


def listed(problems: list[str]) -> str:
    """Problems line by line, the first of them where there are many."""
    shown = problems[:MAX_PROBLEMS_SHOWN]
    more = len(problems) - len(shown)
    return "\n  ".join([f"{len(problems)} problems:", *shown, *([f"and {more} more"] * (more > 0))])


def fill(
    module: nn.Module,
    state: State,
    origin: str,
    skip: tuple[str, ...] = (),
    prefix: str = "",
) -> list[str]:
    """Copy `state`, names with `prefix`, into `module`; what does not fit comes back in lines."""
    wanted = {
        f"{prefix}{k}": v for k, v in module.state_dict().items() if not k.startswith(skip or "\0")
    }
    missing = sorted(set(wanted) - set(state) - OPTIONAL)
    problems = [f"{origin}: {k} {tuple(wanted[k].shape)} is missing" for k in missing]
    problems += [f"{origin}: {k} is not known" for k in sorted(set(state) - set(wanted))]
    with torch.no_grad():
        for key in sorted(set(wanted) & set(state)):
            got, expected = state[key], wanted[key]
            if got.shape != expected.shape:
                problems.append(
                    f"{origin}: {key} is {tuple(got.shape)}, expected {tuple(expected.shape)}"
                )
            elif not torch.isfinite(got).all():
                problems.append(f"{origin}: {key} holds NaN or infinite values")
            else:
                expected.copy_(got)
    return problems
