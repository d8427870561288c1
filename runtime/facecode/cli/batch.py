"""`facecode batch SOURCE --out DEST`: a corpus, resumed where it was stopped."""

from __future__ import annotations

import argparse
from pathlib import Path

from facecode.cli.console import DONE, MISTAKE
from facecode.cli.options import Commands, add_bundle, add_mode, add_quiet, add_style, positive
from facecode.corpus.job import FORMATS
from facecode.corpus.ledger import FAILURES
from facecode.corpus.run import ENGINES, Summary, batch
from facecode.options import parse_style


def add_parser(commands: Commands) -> argparse.ArgumentParser:
    """The sub-command `batch`, with `run` set."""
    parser = commands.add_parser("batch", help="animate a corpus, on all cores or a cluster")
    parser.set_defaults(run=run_batch)
    parser.add_argument(
        "source",
        type=Path,
        help="a folder; a list (.txt; .csv or .jsonl with audio, id, style, template); .parquet "
        "with a column audio; .tar of recordings",
    )
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        metavar="DIR",
        help="a folder, made if need be; run the same command again to go on where it was stopped",
    )
    parser.add_argument(
        "--format",
        choices=FORMATS,
        default="npz",
        help="of the files, or parquet: shards with a row a recording (default: npz)",
    )
    parser.add_argument(
        "--offsets", action="store_true", help="offsets in the rows of --format parquet"
    )
    add_bundle(parser)
    add_style(parser)
    add_mode(parser, "auto")
    _add_engine(parser)
    add_quiet(parser)
    return parser


def _add_engine(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--engine",
        choices=ENGINES,
        default="local",
        help="processes of this machine, or actors of Ray (default: local)",
    )
    parser.add_argument(
        "--address", metavar="HOST:PORT", help="of a running Ray cluster, as in --address auto"
    )
    parser.add_argument(
        "--workers",
        type=positive(int),
        metavar="N",
        help="processes or actors, as in --workers 4 (default: as many as cores)",
    )
    parser.add_argument(
        "--threads",
        type=positive(int),
        default=1,
        metavar="N",
        help="threads of a worker, as in --threads 2 (default: 1, which is the quickest)",
    )


def run_batch(args: argparse.Namespace) -> int:
    """`facecode batch`; 2 if a recording failed, and the others done."""
    summary = batch(
        args.source,
        args.out,
        parse_style(args.style),
        format=args.format,
        bundle=args.bundle,
        offsets=args.offsets,
        workers=args.workers,
        threads=args.threads,
        engine=args.engine,
        address=args.address,
        progress=not args.quiet,
        mode=args.mode,
        window=args.window,
        template=args.template,
    )
    if not args.quiet:
        print(_said(summary, args.out))
    return MISTAKE if summary.failures else DONE


def _said(summary: Summary, out: Path) -> str:
    n_failed = len(summary.failures)
    said = f"{out}: {summary.n - n_failed} of {summary.n} recordings"
    if summary.n_before:
        said += f" ({summary.n_before} were done before)"
    rate = summary.seconds / summary.took_s
    said += f", {summary.seconds:.1f} s of speech in {summary.took_s:.1f} s ({rate:.1f} s a second)"
    return f"{said}; {n_failed} failed, see {out / FAILURES}" if n_failed else said
