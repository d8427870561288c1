"""The engine of one machine: processes that each load the bundle and take portions in turn."""

from __future__ import annotations

import contextlib
import signal
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from facecode.corpus.job import Job, Outcome, Portion
from facecode.corpus.worker import Worker
from facecode.errors import WorkerError

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

MOST_DEATHS = 3
"""Workers that a portion may cost before the batch is given up."""


def run_local(job: Job, portions: Sequence[Portion], n_workers: int) -> Iterator[Outcome]:
    """Do portions in `n_workers` processes, or in this one if that is enough.

    Yields:
        Outcomes as they come.

    Raises:
        WorkerError: a portion that every worker dies of.
    """
    if n_workers == 1:
        worker = Worker(job)
        yield from (worker.do(portion) for portion in portions)
        return
    crew = _Crew(job)
    try:
        yield from crew.run(portions, min(n_workers, len(portions)))
    finally:
        crew.end()


class _Crew:
    """Processes by the pipe to each, with the portion that it has."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._members: dict[Connection, tuple[BaseProcess, Portion]] = {}

    def run(self, portions: Sequence[Portion], n_workers: int) -> Iterator[Outcome]:
        from multiprocessing.connection import wait

        left, deaths = list(reversed(portions)), Counter[int]()
        for _ in range(n_workers):
            self._start(left.pop())
        while self._members:
            ready = wait(list(self._members))
            for pipe in [pipe for pipe in self._members if pipe in ready]:
                process, portion = self._members.pop(pipe)
                try:
                    said: Outcome | Exception = pipe.recv()
                except (EOFError, ConnectionError):
                    process.join()
                    deaths[portion.number] += 1
                    if deaths[portion.number] == MOST_DEATHS:
                        raise _given_up(portion, process.exitcode) from None
                    self._start(portion)
                    continue
                if isinstance(said, Exception):
                    raise said
                if left:
                    self._give(pipe, process, left.pop())
                else:
                    pipe.close()
                    process.join()
                yield said

    def _start(self, portion: Portion) -> None:
        import multiprocessing

        spawn = multiprocessing.get_context("spawn")  # a fork would share onnxruntime's threads
        ours, theirs = spawn.Pipe()
        process = spawn.Process(target=_serve, args=(self._job, theirs), daemon=True)
        process.start()
        theirs.close()  # or the end of the process would not end the pipe
        self._give(ours, process, portion)

    def _give(self, pipe: Connection, process: BaseProcess, portion: Portion) -> None:
        self._members[pipe] = (process, portion)
        with contextlib.suppress(ConnectionError):  # it has died: `run` reads the end of the pipe
            pipe.send(portion)

    def end(self) -> None:
        """Stop all that still work."""
        for process, _ in self._members.values():
            process.terminate()
        for process, _ in self._members.values():
            process.join()


def _given_up(portion: Portion, exit_code: int | None) -> WorkerError:
    ids = ", ".join(r.id for r in portion.recordings)
    return WorkerError(
        f"{MOST_DEATHS} workers died (exit code {exit_code}) of the portion {ids}; if memory was "
        "short, ask for fewer with --workers and run the same command again: what is done is kept"
    )


def _serve(job: Job, pipe: Connection) -> None:
    """A process: portions in, outcomes or what prevents them out, until the pipe ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    try:
        worker = Worker(job)
        while True:
            pipe.send(worker.do(pipe.recv()))
    except (EOFError, ConnectionError):
        return
    except Exception as error:
        with contextlib.suppress(ConnectionError):
            pipe.send(error)
