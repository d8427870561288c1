"""`facecode-export corpus`: make the demo corpus from the command line.

Plugs into the exporter's command line with `add_parser(commands)`.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from facecode_exporter.errors import CorpusError

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]

LONGEST_MINUTES = 24 * 60


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `corpus`, with `run` set."""
    corpus = commands.add_parser("corpus", help="a training corpus made from packages")
    corpus.set_defaults(run=run_corpus)
    corpus.add_argument("--out", type=Path, required=True, metavar="DIR")
    corpus.add_argument("--minutes", type=float, default=90.0, metavar="N", help="of speech")
    corpus.add_argument("--seed", type=int, default=0, metavar="S")
    return corpus


def run_corpus(args: argparse.Namespace) -> None:
    """`facecode-export corpus`; run again, it goes on where it stopped.

    Raises:
        CorpusError: a length or a seed that cannot be meant.
    """
    if not 0 < args.minutes <= LONGEST_MINUTES or args.seed < 0:
        raise CorpusError(
            f"--minutes {args.minutes:g} --seed {args.seed}: expected more than 0 and at most "
            f"{LONGEST_MINUTES} minutes, and a seed of 0 or more"
        )
    from facecode_exporter.demo.corpus import make_corpus

    report = make_corpus(args.out, args.minutes, args.seed, progress=not args.quiet)
    print(f"{args.out}: {report.n_clips} clips, {report.seconds / 60:.1f} min")
    print(f"  {report.lip_sync}")
