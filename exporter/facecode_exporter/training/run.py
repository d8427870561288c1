"""The epoch loop: progress, loss curves, checkpoints, resuming.

Randomness is drawn from (seed, epoch) alone and a checkpoint is written after every epoch, so a run
that was interrupted and resumed gives the weights of one that was not.
"""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from torch import Tensor, nn
from tqdm import tqdm

from facecode.arrays import AnyArray, Float32
from facecode.errors import OutputWriteError
from facecode.writers import writing
from facecode_exporter.errors import RunError
from facecode_exporter.state_files import save_state
from facecode_exporter.training.config import CONFIG_FILE, TrainingConfig

CHECKPOINT, CURVES, BEGUN = "checkpoint.pt", "losses.csv", "begun.json"


class Stage(Protocol):
    """What the loop needs of a stage."""

    @property
    def terms(self) -> Sequence[str]:
        """Names of the loss terms."""

    @property
    def trained(self) -> nn.Module:
        """Everything that a checkpoint holds."""

    def lessons(self) -> Iterator[Float32]:
        """What it learns from, clip by clip: arrays that differ where the lessons do."""

    def epoch(self, rng: np.random.Generator) -> Iterator[tuple[Tensor, list[Tensor]]]:
        """(loss, terms) of every training batch."""

    def end_epoch(self, rng: np.random.Generator) -> None:
        """After the last batch."""

    def validate(self) -> list[float]:
        """Loss terms on the validation split."""


def train(stage: Stage, config: TrainingConfig, folder: Path, progress: bool = False) -> None:
    """Train for `config.epochs`, going on from a checkpoint in `folder` if there is one.

    Raises:
        RunError: `folder` holds a run with another configuration, that began with other weights
            (another stage 1, speech encoder, number of samples) or learns from other data.
    """
    _claim(folder, config)
    _claim_beginning(folder, stage)
    parameters = [p for p in stage.trained.parameters() if p.requires_grad]
    optimizer = torch.optim.AdamW(
        parameters, lr=config.learning_rate, weight_decay=config.weight_decay
    )
    first = _resume(folder, stage, optimizer)
    for epoch in range(first, config.epochs):
        rate = config.learning_rate
        if config.halve_every is not None:
            rate *= 0.5 ** (epoch // config.halve_every)
        for group in optimizer.param_groups:
            group["lr"] = rate
        rng = np.random.default_rng((config.seed, epoch))
        torch.manual_seed(config.seed * 1_000_003 + epoch)
        terms = _epoch(stage, optimizer, rng, f"epoch {epoch + 1}/{config.epochs}", progress)
        stage.end_epoch(rng)
        _note(folder, stage, epoch, terms, stage.validate())
        _save(folder, stage, optimizer, epoch + 1)


def _epoch(
    stage: Stage,
    optimizer: torch.optim.Optimizer,
    rng: np.random.Generator,
    name: str,
    progress: bool,
) -> list[float]:
    sums = np.zeros(len(stage.terms))
    n_batches = 0
    stage.trained.train()
    with tqdm(stage.epoch(rng), desc=name, unit="batch", disable=not progress) as bar:
        for loss, terms in bar:
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            optimizer.step()
            sums += [float(t.detach()) for t in terms]
            n_batches += 1
            if n_batches % 20 == 0:
                bar.set_postfix_str(f"loss {float(loss.detach()):.4g}")
    return list(sums / max(n_batches, 1))


def _claim(folder: Path, config: TrainingConfig) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputWriteError(
            f"cannot make the folder {folder}: {error.strerror}; name another with --out"
        ) from error
    if (folder / CONFIG_FILE).is_file():
        before = TrainingConfig.load(folder)
        if before != config:
            raise RunError(
                f"{folder} holds a run with another configuration; name another folder, or the "
                f"same options as in {folder / CONFIG_FILE}"
            )
    config.save(folder)


def _claim_beginning(folder: Path, stage: Stage) -> None:
    """What the configuration does not say: the weights before the first step, and the data."""
    state = stage.trained.state_dict()
    begun = {
        "weights": _digest(v.cpu().numpy() for v in state.values()),
        "data": _digest(stage.lessons()),
    }
    file = folder / BEGUN
    if not (folder / CHECKPOINT).is_file():
        with writing(file) as out:
            out.write(json.dumps(begun).encode())
    elif file.is_file() and (before := json.loads(file.read_text())) != begun:
        differing = " and ".join(name for name in begun if begun[name] != before.get(name))
        raise RunError(
            f"{folder} holds a run that began with other {differing} (another --stage1, "
            "--speech-encoder, --samples, --lips, --lip-pair or --data); name another folder, or "
            "give what it began with"
        )


def _digest(arrays: Iterable[AnyArray]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(f"{array.shape} {array.dtype}".encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _resume(folder: Path, stage: Stage, optimizer: torch.optim.Optimizer) -> int:
    file = folder / CHECKPOINT
    if not file.is_file():
        return 0
    try:
        saved = torch.load(file, weights_only=True)
        stage.trained.load_state_dict(saved["trained"])
        optimizer.load_state_dict(saved["optimizer"])
        return int(saved["epoch"])
    except Exception as error:  # torch raises whatever it stumbles over
        raise RunError(
            f"{file} is no checkpoint of this run, or is damaged; remove it to begin anew"
        ) from error


def _save(folder: Path, stage: Stage, optimizer: torch.optim.Optimizer, epoch: int) -> None:
    state = {
        "trained": stage.trained.state_dict(),
        "optimizer": optimizer.state_dict(),
        "epoch": epoch,
    }
    save_state(state, folder / CHECKPOINT)


def _note(
    folder: Path, stage: Stage, epoch: int, train_terms: list[float], val_terms: list[float]
) -> None:
    """Append the epoch to the curves; an epoch that is run again after an interrupt stands once."""
    header = ["epoch", *(f"train_{t}" for t in stage.terms), *(f"val_{t}" for t in stage.terms)]
    file = folder / CURVES
    rows = []
    if file.is_file():
        lines = csv.reader(file.read_text().splitlines())
        rows = [row for row in lines if row[0].isdigit() and int(row[0]) <= epoch]
    rows.append([str(epoch + 1), *(f"{v:.6g}" for v in (*train_terms, *val_terms))])
    text = io.StringIO(newline="")
    csv.writer(text).writerows([header, *rows])
    with writing(file) as out:
        out.write(text.getvalue().encode())
    with contextlib.suppress(ModuleNotFoundError):
        plot_curves(file, file.with_suffix(".png"))


def plot_curves(curves: Path, picture: Path) -> None:
    """Draw losses.csv, one panel a term, training and validation; needs matplotlib."""
    from matplotlib.figure import Figure

    with curves.open() as file:
        rows = list(csv.DictReader(file))
    terms = [name.removeprefix("train_") for name in rows[0] if name.startswith("train_")]
    figure = Figure(figsize=(4 * len(terms), 3), layout="constrained")
    for i, term in enumerate(terms):
        axes = figure.add_subplot(1, len(terms), i + 1)
        for split in ("train", "val"):
            values = [float(row[f"{split}_{term}"]) for row in rows]
            axes.plot([int(row["epoch"]) for row in rows], values, label=split)
        axes.set(title=term, xlabel="epoch", yscale="log")
        axes.legend()
    figure.savefig(picture, dpi=100)
