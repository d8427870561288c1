"""Checkpoints with random weights in the public layout.

Latency does not depend on the weights, so that anyone can export and benchmark the full-size
systems without a licence.
"""

from __future__ import annotations

from pathlib import Path

import torch

from facecode_exporter.checkpoints import save_system
from facecode_exporter.faceformer_checkpoint import save_faceformer
from facecode_exporter.nets.faceformer import FaceFormer
from facecode_exporter.nets.networks import Network, network_of
from facecode_exporter.output_folder import replacing
from facecode_spec.graphs import part_file
from facecode_spec.schema import SystemSpec

STAGE1, STAGE2 = "stage1", "stage2"
LIPS_FILE = "lips.txt"
ONE_FILE = "faceformer.pth"


def random_network(system: SystemSpec, seed: int) -> Network:
    """An untrained network with torch's default initialisation; the same for the same seed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return network_of(system).eval()


def write_random_checkpoints(system: SystemSpec, out: Path, seed: int) -> list[Path]:
    """Write both stages of each part, or a system's one file, into `out` and return their paths.

    For a system of several parts a region file stands beside them: the lip part is the mesh's first
    vertices, since random weights know no lips.

    Raises:
        OutputFolderError, OutputExistsError.
    """
    net = random_network(system, seed)
    if isinstance(net, FaceFormer):
        with replacing(out, ONE_FILE) as folder:
            save_faceformer(net, folder / ONE_FILE)
        return [out / ONE_FILE]
    stages = [
        [f"{part_file(system, part, stage)}.pth.tar" for part in system.parts]
        for stage in (STAGE1, STAGE2)
    ]
    with replacing(out, stages[0][0]) as folder:
        first, second = ([folder / name for name in stage] for stage in stages)
        save_system(net, first, second)
        if system.family == "cdface":
            n_lips = system.vertices_of(system.part("lips"))
            (folder / LIPS_FILE).write_text(",".join(map(str, range(n_lips))) + "\n")
    return [out / name for stage in stages for name in stage]
