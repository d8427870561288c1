"""A local Ray with two actors gives the files of the local engine, though one is killed."""

import os
import signal
import subprocess
import threading
import time

import pytest
from conftest import TINY, contents

import facecode

pytest.importorskip("ray.data")


def actors():
    found = subprocess.run(
        ["ps", "-eo", "pid,ppid,args"], capture_output=True, text=True, check=True
    )
    lines = [line.split(None, 2) for line in found.stdout.splitlines()]
    return [int(pid) for pid, _, args in lines if "MapWorker" in args and "ray::" in args]


@pytest.mark.parametrize("killed", [False, True])
def test_the_files_of_the_local_engine(speeches, tmp_path, killed):
    options = {"bundle": str(TINY), "workers": 2}
    facecode.batch(speeches, tmp_path / "local", **options)
    before, dead = set(actors()), []

    def kill_one():
        deadline = time.monotonic() + 100
        while time.monotonic() < deadline and not dead:
            for pid in set(actors()) - before:
                os.kill(pid, signal.SIGKILL)
                dead.append(pid)
                return
            time.sleep(0.05)

    killer = threading.Thread(target=kill_one)
    if killed:
        killer.start()
    summary = facecode.batch(speeches, tmp_path / "ray", engine="ray", **options)
    if killed:
        killer.join()
        assert dead
    assert [f.id for f in summary.failures] == ["bad"]
    assert contents(tmp_path / "ray") == contents(tmp_path / "local")
