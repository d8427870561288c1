"""Checkpoints with random weights in the public layout.

Latency does not depend on the weights, so that anyone can export and benchmark the full-size
systems without a licence.
"""

from __future__ import annotations

from pathlib import Path

import torch

from facecode_exporter.checkpoints import save_codetalker
from facecode_exporter.nets.codetalker import CodeTalker
from facecode_exporter.output_folder import replacing
from facecode_spec.schema import SystemSpec

STAGE1, STAGE2 = "stage1.pth.tar", "stage2.pth.tar"


def random_codetalker(system: SystemSpec, seed: int) -> CodeTalker:
    """An untrained network with torch's default initialisation; the same for the same seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return CodeTalker(system).eval()


def write_random_checkpoints(system: SystemSpec, out: Path, seed: int) -> tuple[Path, Path]:
    """Write both stages into the folder `out` and return their paths.

    Raises:
        OutputFolderError, OutputExistsError.
    """
    with replacing(out, STAGE1) as folder:
        save_codetalker(random_codetalker(system, seed), folder / STAGE1, folder / STAGE2)
    return out / STAGE1, out / STAGE2
