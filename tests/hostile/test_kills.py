"""Processes that are killed while they write; kill_run.py does it as often as is wanted."""

import os
import subprocess
import sys
from pathlib import Path

from facecode import writers


def test_every_writer_leaves_the_old_file_or_the_new_one():
    command = [sys.executable, Path(__file__).with_name("kill_run.py"), "--writers", "5"]
    env = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=env)
    assert done.returncode == 0, done.stdout + done.stderr
    assert set(done.stdout.splitlines()) == {f"writers {f} whole 5" for f in writers.FORMATS}
