"""The engine of many machines: Ray Data, with one loaded bundle an actor.

Portions and outcomes travel; actors write the results into a folder that all machines see.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from types import ModuleType
from typing import Any

from facecode.corpus.job import Job, Outcome, Portion
from facecode.corpus.worker import Worker
from facecode.errors import MissingExtraError

PORTION, OUTCOME = "portion", "outcome"


def check_ray() -> ModuleType:
    """The package ray, with ray.data.

    Raises:
        MissingExtraError
    """
    try:
        import ray
        import ray.data
    except ImportError as error:
        raise MissingExtraError.of("--engine ray", "ray[data]", "ray") from error
    return ray  # type: ignore[no-any-return]


def run_on_ray(
    job: Job, portions: Sequence[Portion], n_workers: int, address: str | None
) -> Iterator[Outcome]:
    """Do portions on a cluster; Ray starts an actor anew that dies, and gives it its portion again.

    Args:
        job: what all share; its threads are the cores of an actor.
        portions: what to do.
        n_workers: actors.
        address: of a running cluster; None: the one of this process, or a new local one.

    Yields:
        Outcomes as they come.

    Raises:
        MissingExtraError
    """
    ray = check_ray()
    begun = not ray.is_initialized()
    if begun:
        cores = None if address else n_workers * job.compute.n_threads
        ray.init(
            address=address,
            num_cpus=cores,
            log_to_driver=False,
            logging_level="error",
            include_dashboard=None if address else False,
        )
    try:
        context = ray.data.DataContext.get_current()
        context.enable_progress_bars = False
        items = [{PORTION: pickle.dumps(portion)} for portion in portions]
        n_blocks = max(1, len(items))
        outcomes = ray.data.from_items(items, override_num_blocks=n_blocks).map_batches(
            _Actor,
            fn_constructor_args=(job,),
            batch_size=1,
            compute=ray.data.ActorPoolStrategy(size=n_workers),
            num_cpus=job.compute.n_threads,
        )
        for row in outcomes.iter_rows():
            yield pickle.loads(row[OUTCOME])
    finally:
        if begun:
            ray.shutdown()


class _Actor:
    """A worker as Ray Data calls it: a batch of portions in, a batch of outcomes out."""

    def __init__(self, job: Job) -> None:
        self._worker = Worker(job)

    def __call__(self, batch: dict[str, Any]) -> dict[str, list[bytes]]:
        done = (self._worker.do(pickle.loads(portion)) for portion in batch[PORTION])
        return {OUTCOME: [pickle.dumps(outcome) for outcome in done]}
