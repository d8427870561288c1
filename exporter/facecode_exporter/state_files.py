"""State dicts: read from files, and copied into modules with all that does not fit named."""

from __future__ import annotations

import re
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from facecode.errors import OutputWriteError
from facecode.writers import writing
from facecode_exporter.errors import CheckpointError, CheckpointNotFoundError

State = dict[str, Tensor]

OPTIONAL = {"audio_encoder.masked_spec_embed"}
MAX_PROBLEMS_SHOWN = 12
HOLDERS = ("state_dict", "model_state_dict", "model", "net", "network", "ema")
"""Under which programs store the weights beside other things."""
WRAPPERS = r"(^|\.)((module|_orig_mod|_fsdp_wrapped_module|_checkpoint_wrapped_module)\.)+"
"""What torch's own wrappers put into names."""
MOST_PER_BYTE = 4
"""Numbers that a file may hold for each of its bytes; half precision has half a one."""
SAVE = "torch.save({'state_dict': net.state_dict()}, FILE)"
KINDS = (
    (rb"\s*<", "a web page, not the file that it offers; download the file itself"),
    (rb"version https://git-lfs", "a Git LFS pointer; fetch the file itself with `git lfs pull`"),
    (rb".{8}\{", f"a safetensors file; load it with safetensors and store it again with {SAVE}"),
    (rb"\x1f\x8b|BZh|\xfd7zXZ|7z\xbc\xaf|Rar!", "a compressed archive; unpack it first"),
    (rb".{257}ustar", "a tar archive; unpack it first"),
)
"""How files begin that people take for checkpoints, and what they are."""


def read_state(path: Path) -> State:
    """The state dict of a checkpoint file, names without those of wrappers, values float32.

    Raises:
        CheckpointNotFoundError: no such file.
        CheckpointError: not a file of tensors, or several sets of them.
    """
    if not path.is_file():
        what = "a folder, not a file, is" if path.is_dir() else "no checkpoint file"
        raise CheckpointNotFoundError(f"{what} at {path}")
    state = _weights(_content(path), path)
    tensors = {str(name): value for name, value in state.items() if _is_weight(value)}
    if not tensors:
        raise CheckpointError(f"{path} holds no tensors; expected a file of {SAVE}")
    n_numbers = 0
    for name, value in tensors.items():
        if not value.is_floating_point() or value.layout != torch.strided or value.is_meta:
            raise CheckpointError(
                f"{path}: {name!r} is {value.dtype} ({value.layout}); expected plain tensors of "
                "floating-point numbers"
            )
        n_numbers += value.numel()
    if n_numbers > MOST_PER_BYTE * path.stat().st_size:
        raise CheckpointError(f"{path} states {n_numbers:,} numbers, more than it can hold")
    return _renamed(tensors, path)


def _content(path: Path) -> Any:  # noqa: ANN401
    with path.open("rb") as file:
        head = file.read(512)
    if not head:
        raise CheckpointError(f"{path} is empty; copy it again")
    for pattern, what in KINDS:
        if re.match(pattern, head, re.S):
            raise CheckpointError(f"{path} is {what}")
    try:
        _refuse_bomb(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises whatever it stumbles over
        named = re.search(r"GLOBAL (\S+)|Unsupported (?:global|class) (\S+)", str(error))
        if named is not None:
            raise CheckpointError(
                f"{path} holds objects of {(named[1] or named[2]).rstrip('.')} beside tensors, "
                f"which are not loaded; store the weights alone: {SAVE}"
            ) from error
        if "TorchScript" in str(error):
            raise CheckpointError(
                f"{path} is a TorchScript program; store its weights: {SAVE}"
            ) from error
        raise CheckpointError(
            f"{path} is not a PyTorch checkpoint of tensors, or is damaged or cut short; copy it "
            f"again, or store the weights with {SAVE}"
        ) from error


def _refuse_bomb(path: Path) -> None:
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > MOST_PER_BYTE * path.stat().st_size:
            raise ValueError(f"unpacks to {unpacked:,} bytes")


def _weights(content: object, path: Path) -> Mapping[Any, Any]:
    """The mapping of tensors, wherever it lies in what the file holds."""
    for _ in range(len(HOLDERS)):
        if not isinstance(content, Mapping):
            break
        found = [key for key in HOLDERS if isinstance(content.get(key), Mapping)]
        if not found:
            return content
        if len(found) > 1:
            raise CheckpointError(
                f"{path} holds several sets of weights: {', '.join(found)}; store the one that is "
                f"meant: {SAVE}"
            )
        content = content[found[0]]
    raise CheckpointError(
        f"{path} holds {type(content).__name__}, no 'state_dict' with tensors; store them with "
        f"{SAVE}"
    )


def _is_weight(value: object) -> bool:
    """Counters and settings beside the weights are left out."""
    return isinstance(value, Tensor) and (value.dim() > 0 or value.is_floating_point())


def _renamed(tensors: State, path: Path) -> State:
    state: State = {}
    for name, value in tensors.items():
        plain = re.sub(WRAPPERS, r"\1", name)
        if plain in state:
            raise CheckpointError(f"{path} holds {plain!r} twice; store the weights with {SAVE}")
        state[plain] = value.detach().float()
    return state


def save_state(content: object, path: Path) -> None:
    """As torch.save; whole or not at all.

    Raises:
        OutputFolderError, OutputWriteError.
    """
    try:
        with writing(path) as file:
            torch.save(content, file)
    except RuntimeError as error:
        if not re.search("PytorchStreamWriter|inline_container", str(error)):
            raise
        raise OutputWriteError(f"cannot write {path}: the disk is full, or went away") from error


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
