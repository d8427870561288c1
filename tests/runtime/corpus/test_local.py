"""A worker that dies costs nothing; one that always dies ends the batch with a word why."""

import os
import signal
import threading
import time

import pytest
from conftest import TINY

from facecode.corpus import ledger
from facecode.corpus.job import Job, portions_of
from facecode.corpus.local import run_local
from facecode.corpus.sources import recordings_in
from facecode.errors import BundleNotFoundError
from facecode.session import Compute


def job_of(out, bundle=TINY):
    return Job(out, "npz", str(bundle), Compute(1), None, {}, False)


def test_a_worker_that_is_killed_is_replaced(speeches, tmp_path):
    import multiprocessing

    job, portions = job_of(tmp_path / "out"), portions_of(recordings_in(speeches), "npz")
    ledger.open_ledger(job, portions, "")
    killed = []

    def kill_one():
        deadline = time.monotonic() + 60
        while time.monotonic() < deadline and not killed:
            for child in multiprocessing.active_children():
                os.kill(child.pid, signal.SIGKILL)
                killed.append(child.pid)
                return
            time.sleep(0.01)

    killer = threading.Thread(target=kill_one)
    killer.start()
    outcomes = list(run_local(job, portions, 2))
    killer.join()
    assert killed
    assert sorted(o.number for o in outcomes) == [p.number for p in portions]
    assert not multiprocessing.active_children()


def test_what_prevents_all_is_raised_here(speeches, tmp_path):
    job, portions = (
        job_of(tmp_path / "out", tmp_path),
        portions_of(recordings_in(speeches), "npz"),
    )
    with pytest.raises(BundleNotFoundError):
        list(run_local(job, portions, 2))
