"""Animate a corpus: plan it, leave out what is done, give the rest to an engine, sum up."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from facecode import writers
from facecode.bundle import PACKAGED_BUNDLE, Bundle
from facecode.corpus import ledger
from facecode.corpus.cluster import check_ray, run_on_ray
from facecode.corpus.job import FORMATS, PARQUET, Failure, Job, Outcome, Portion, portions_of
from facecode.corpus.local import run_local
from facecode.corpus.sources import recordings_in
from facecode.corpus.tables import parquet
from facecode.errors import ModeError, NoVerticesError, OutputSuffixError
from facecode.options import BatchOptions, Style
from facecode.session import Compute, usable_cores

if TYPE_CHECKING:
    from typing_extensions import Unpack

EngineName: TypeAlias = Literal["local", "ray"]
ENGINES: tuple[EngineName, ...] = ("local", "ray")


@dataclass(frozen=True)
class Summary:
    """What became of a batch."""

    n: int
    """Recordings of the corpus."""
    n_before: int
    """Those that were done before it was taken up again."""
    failures: tuple[Failure, ...]
    """Those that could not be animated, by name, and why."""
    seconds: float
    """Of speech that was animated now."""
    took_s: float
    """How long that took, with the loading of bundles."""


def batch(
    source: str | os.PathLike[str],
    out: str | os.PathLike[str],
    style: Style | None = None,
    *,
    format: str = "npz",
    bundle: str | None = None,
    offsets: bool = False,
    workers: int | None = None,
    threads: int = 1,
    engine: EngineName = "local",
    address: str | None = None,
    progress: bool = False,
    **options: Unpack[BatchOptions],
) -> Summary:
    """Animate a corpus into a folder; run again, it goes on where it was stopped.

    Results are the same to the bit with any engine and any number of workers. With several workers
    call it below `if __name__ == "__main__":`, since they import the calling script.

    Args:
        source: a folder, a list, Parquet or tar files; see `facecode.corpus.sources`.
        out: a folder, made if need be.
        style: of recordings that name none; the bundle's first by default.
        format: of the files, `npz`, `csv`, ...; or `parquet`: a row a recording.
        bundle: a folder, or the name of a packaged bundle.
        offsets: whether rows of Parquet have offsets beside codes and weights.
        workers: processes, or actors of Ray; as many as cores for one thread each by default.
        threads: of a worker.
        engine: `local`, or `ray`.
        address: of a running Ray cluster.
        progress: show a bar on stderr.
        **options: `mode`, `window`, `template` of recordings that name none.

    Raises:
        CorpusError, CorpusNotFoundError: nothing that can be animated.
        OtherBatchError: the folder holds another batch.
        WorkerError: workers die again and again.
        BundleError, StyleError, TemplateError, ModeError, OutputError, MissingExtraError: before
            the first recording, or what prevents all.
        ValueError: a number of workers below 1.
    """
    if workers is not None and workers < 1:
        raise ValueError(f"got {workers} workers; expected at least 1")
    if engine == "ray":
        check_ray()
    start, folder = time.perf_counter(), Path(out)
    opened = Bundle.open(PACKAGED_BUNDLE if bundle is None else bundle)
    _check(opened, format, offsets, options)
    job = Job(folder.absolute(), format, bundle, Compute(threads), style, options, offsets)
    portions = portions_of(recordings_in(source), format)
    done = ledger.done(ledger.open_ledger(job, portions, repr(opened.manifest)))
    left = [portion for portion in portions if portion.number not in done]
    n_workers = max(1, usable_cores() // threads) if workers is None else workers
    new: list[Outcome] = []
    if left:
        run = _outcomes(job, left, n_workers, engine, address)
        new = list(_shown(run, portions, list(done.values()), progress))
    failures = [f for outcome in (*done.values(), *new) for f in outcome.failures]
    ledger.write_failures(folder, failures)
    return Summary(
        n=sum(len(portion.recordings) for portion in portions),
        n_before=sum(outcome.n for outcome in done.values()),
        failures=tuple(sorted(failures, key=lambda failure: failure.id)),
        seconds=sum(outcome.seconds for outcome in new),
        took_s=time.perf_counter() - start,
    )


def _outcomes(
    job: Job, left: Sequence[Portion], n_workers: int, engine: EngineName, address: str | None
) -> Iterator[Outcome]:
    if engine == "ray":
        return run_on_ray(job, left, n_workers, address)
    return run_local(job, left, n_workers)


def _shown(
    outcomes: Iterator[Outcome], portions: Sequence[Portion], done: list[Outcome], progress: bool
) -> Iterator[Outcome]:
    """The outcomes, counted by a bar."""
    n, start, seconds = sum(len(p.recordings) for p in portions), time.perf_counter(), 0.0
    before = sum(outcome.n for outcome in done)
    from tqdm import tqdm

    with tqdm(total=n, initial=before, desc="batch", unit="clip", disable=not progress) as bar:
        for outcome in outcomes:
            seconds += outcome.seconds
            bar.set_postfix_str(
                f"{seconds / (time.perf_counter() - start):.1f} s of speech a second"
            )
            bar.update(outcome.n)
            yield outcome


def _check(bundle: Bundle, output_format: str, offsets: bool, options: BatchOptions) -> None:
    """Refuse what no recording can have, before the first."""
    if options.get("mode") == "live":
        raise ModeError("got mode live; a batch is animated in auto, exact or window")
    if output_format not in FORMATS:
        raise OutputSuffixError(
            f"got the format {output_format!r}; expected one of {', '.join(FORMATS)}"
        )
    bundle.neutral(options.get("template"))
    if output_format == PARQUET:
        parquet()
        return
    if offsets:
        raise NoVerticesError(
            f"got offsets beside the format {output_format!r}; they are for Parquet: leave them out"
        )
    found = writers.FORMATS[f".{output_format}"]
    writers.check_face(found, bundle.faces is not None, bundle.rig is not None)
    if found.check is not None:
        found.check()
