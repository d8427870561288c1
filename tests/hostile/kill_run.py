"""Kill processes with signal 9 at random moments, and look at what they leave.

    python tests/hostile/kill_run.py --seed 1 --writers 200 --export 40 --train 40 --batch 40

A file or folder is the old one or the new one, whole, and nothing lies beside it; a run that is
started again ends with the results of one that was never killed.
"""

import argparse
import collections
import contextlib
import io
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent)]


def forked(work):
    """A child that does `work` and ends; its id."""
    child = os.fork()
    if child == 0:
        code = 1
        try:
            os.setpgid(0, 0)
            quiet = os.open(os.devnull, os.O_WRONLY)
            os.dup2(quiet, 1)
            if "KILL_RUN_SHOW" not in os.environ:
                os.dup2(quiet, 2)
            work()
            code = 0
        finally:
            os._exit(code)
    with contextlib.suppress(OSError):
        os.setpgid(child, child)
    return child


def kill_after(work, seconds):
    """Whether a child that does `work` was killed before its end."""
    child = forked(work)
    time.sleep(seconds)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if not os.WIFSIGNALED(status) and os.waitstatus_to_exitcode(status):
        raise AssertionError(f"the work itself failed: {os.waitstatus_to_exitcode(status)}")
    return os.WIFSIGNALED(status)


def seconds_of(work):
    """How long a child takes for `work`."""
    start = time.perf_counter()
    child = forked(work)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0, "the work itself failed"
    return time.perf_counter() - start


def kill_writers(n, seed, formats=None):
    """Two clips are saved in turns under one name, and the process killed: what is there then."""
    from small_faces import rigged

    from facecode import writers

    clips = [rigged(30, seed=1), rigged(30, seed=2)]
    dice, found = random.Random(seed), collections.Counter()
    for suffix in formats or writers.FORMATS:
        folder = Path(tempfile.mkdtemp())
        path = folder / f"talk{suffix}"

        def save(clip, path=path):
            writers.save(clip, path)

        whole = []
        for clip in clips:
            took = seconds_of(lambda clip=clip: save(clip))
            whole.append(path.read_bytes())

        def save_in_turns():
            for turn in range(10_000):
                save(clips[turn % 2])

        for _ in range(n):
            kill_after(save_in_turns, dice.random() * min(4 * took, 1) + 0.002)
            names = sorted(file.name for file in folder.iterdir())
            if names != [path.name]:
                found[suffix, "left over"] += 1
                for file in folder.iterdir():
                    if file != path:
                        file.unlink()
            found[suffix, "whole" if path.read_bytes() in whole else "half"] += 1
        shutil.rmtree(folder)
    return found


def kill_export(n, seed):
    """A bundle is exported over another, again and again; it opens at every moment."""
    from facecode.bundle import Bundle
    from facecode_exporter.cli.main import main

    folder = Path(tempfile.mkdtemp())
    system = ["--system", "codetalker-tiny"]
    with contextlib.redirect_stdout(io.StringIO()):
        assert main(["init", *system, "--out", str(folder / "random"), "--quiet"]) == 0
    files = [f"--stage{k}={folder / 'random' / f'stage{k}.pth.tar'}" for k in (1, 2)]
    out = folder / "bundle"

    def export():
        assert main(["export", *system, *files, "--out", str(out), "--quiet"]) == 0

    took, dice, found = seconds_of(export), random.Random(seed), collections.Counter()
    for _ in range(n):
        killed = kill_after(export, dice.random() * took)
        Bundle.open(out)
        found["killed" if killed else "ended"] += 1
    time.sleep(2.5)
    seconds_of(export)
    Bundle.open(out)
    found["left over"] = len({file.name for file in folder.iterdir()} - {"random", "bundle"})
    shutil.rmtree(folder)
    return found


def kill_train(n, seed):
    """A run of stage 1 is killed and started again until it ends: the weights are the same."""
    from conftest import make_folder

    from facecode_exporter.cli.main import main
    from facecode_exporter.state_files import read_state

    folder = Path(tempfile.mkdtemp())
    data = make_folder(folder / "data", "vocaset", 12)
    config = folder / "config.yaml"
    text = (HERE.parent / "data/codetalker-vocaset-tiny/config.yaml").read_text()
    import yaml

    from facecode_exporter.data.data_set import LAYOUTS

    tree = yaml.safe_load(text)
    for section in tree.values():
        for key in set(section) & {"in_dim", "vertice_dim"}:
            section[key] = 36
        if "train_subjects" in section:
            section["train_subjects"] = " ".join(LAYOUTS["vocaset"].seen[:2])
    config.write_text(yaml.safe_dump(tree))

    def train(out):
        command = ["train", "stage1", "--data", str(data), "--config", str(config)]
        assert main([*command, "--out", str(out), "--epochs", "4", "--quiet"]) == 0

    took, dice = seconds_of(lambda: train(folder / "whole")), random.Random(seed)
    whole = read_state(folder / "whole/stage1.pth.tar")
    found, kills = collections.Counter(), 0
    while kills < n:
        out = Path(tempfile.mkdtemp(dir=folder))
        while kills < n and kill_after(lambda out=out: train(out), dice.random() * took):
            kills += 1
            found["left over"] += len([f for f in out.iterdir() if f.name.startswith(".")])
        seconds_of(lambda out=out: train(out))
        state = read_state(out / "stage1.pth.tar")
        same = whole.keys() == state.keys() and all((state[k] == whole[k]).all() for k in whole)
        found["the same weights" if same else "other weights"] += 1
        shutil.rmtree(out)
    shutil.rmtree(folder)
    return found | {"killed": kills}


def kill_batch(n, seed):
    """A batch of two workers is killed with them and started again: the files are the same."""
    import numpy as np
    import soundfile
    from conftest import TINY, contents

    from facecode.cli import main

    folder = Path(tempfile.mkdtemp())
    (folder / "in").mkdir()
    rng = np.random.default_rng(0)
    for k in range(8):
        soundfile.write(folder / f"in/{k}.wav", rng.standard_normal(12_000) / 20, 16_000)

    def batch(out):
        command = ["batch", str(folder / "in"), "--out", str(out), "--bundle", str(TINY)]
        assert main([*command, "--workers", "2", "--quiet"]) == 0

    took, dice = seconds_of(lambda: batch(folder / "whole")), random.Random(seed)
    whole, found, kills = contents(folder / "whole"), collections.Counter(), 0
    while kills < n:
        out = folder / "out"
        while kills < n and kill_after(lambda out=out: batch(out), dice.random() * took):
            kills += 1
        seconds_of(lambda out=out: batch(out))
        found["the same files" if contents(out) == whole else "other files"] += 1
        found["left over"] += len(list(out.rglob(".facecode-*")))
        shutil.rmtree(out)
    shutil.rmtree(folder)
    return found | {"killed": kills}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    works = {
        "writers": kill_writers,
        "export": kill_export,
        "train": kill_train,
        "batch": kill_batch,
    }
    for name in works:
        parser.add_argument(f"--{name}", type=int, default=0, metavar="N")
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    bad = 0
    for name, work in works.items():
        if n := getattr(args, name):
            for what, count in work(n, args.seed).items():
                print(name, *(what if isinstance(what, tuple) else (what,)), count, flush=True)
                wrong = {"half", "left over", "other weights", "other files"}
                bad += count * bool(wrong & {*(what if isinstance(what, tuple) else (what,))})
    sys.exit(bad > 0)


if __name__ == "__main__":
    main()
