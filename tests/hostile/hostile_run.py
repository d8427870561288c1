"""Try damaged inputs in processes of their own, and count what happens.

    python tests/hostile/hostile_run.py --seed 1 --bundle 10000 --recording 10000

Of each input: refused with one clear line, or taken. Not allowed: a process that dies, more than
--longest seconds, an error of another class than facecode's, a message that is not a line, a read
outside of the input's folder, more memory than the bound.
"""

import argparse
import collections
import contextlib
import ctypes
import json
import os
import re
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

HERE = Path(__file__).parent
KINDS = ("bundle", "recording", "clip", "template", "avatar", "style", "config", "checkpoint")
KNOWN_NOISE = re.compile(
    r"\*+ ?EP Error|EP Error|Falling|\*+$|.*onnxruntime:Default, allocator|.*nmemb=|Error|Note: "
    r"|Warning: Xing|.*src/libmpg123/|\s*$"
)
"""What libraries print: onnxruntime where memory is refused, libsndfile on damaged MP3 and SDS."""
IN_ACCESS, IN_OPEN = 0x1, 0x20


class Child:
    """The process, started again whenever it dies."""

    def __init__(self, base, longest_s):
        self.base, self.longest_s, self.process = base, longest_s, None

    def start(self):
        env = os.environ | {
            "OMP_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join(
                [str(HERE), str(HERE.parent), *filter(None, [os.environ.get("PYTHONPATH")])]
            ),
        }
        self.process = subprocess.Popen(
            [sys.executable, HERE / "hostile_child.py", self.base],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
            env=env,
            cwd=self.base,
        )
        self.fresh = True

    def ask(self, kind, seed, number):
        if self.process is None or self.process.poll() is not None:
            self.start()
        self.process.stdin.write(f"{kind} {seed} {number}\n")
        self.process.stdin.flush()
        longest_s = self.longest_s + (120 if self.fresh else 0)  # imports
        ready, _, _ = select.select([self.process.stdout], [], [], longest_s)
        line = self.process.stdout.readline() if ready else ""
        if not ready:
            self.process.kill()
            self.process.wait()
            return {"outcome": "hang"}
        if not line:
            return {"outcome": "crash", "message": f"exit {self.process.wait()}"}
        self.fresh = False
        return json.loads(line)

    def stop(self):
        if self.process is not None:
            self.process.stdin.close()
            self.process.wait()


class Canary:
    """A folder that no input may lead to; the kernel tells who opens what is in it."""

    def __init__(self, folder):
        folder.mkdir()
        (folder / "secret.npy").write_bytes(b"\x93NUMPY secret")
        libc = ctypes.CDLL(None, use_errno=True)
        self.handle = libc.inotify_init1(os.O_NONBLOCK)
        libc.inotify_add_watch(self.handle, os.fsencode(folder), IN_ACCESS | IN_OPEN)

    def seen(self):
        """Names of files that were opened or read since the last time."""
        with contextlib.suppress(BlockingIOError):
            data, names = os.read(self.handle, 1 << 16), []
            while data:
                _, mask, _, size = struct.unpack("iIII", data[:16])
                if not mask & 0x40000000:  # a folder that is listed
                    names.append(data[16 : 16 + size].rstrip(b"\0").decode())
                data = data[16 + size :]
            return names
        return []


def run(counts, seed, n_workers=1, longest_s=5.0, tell=lambda line: None, first=0):
    """Counts of outcomes by kind, and every failure."""
    jobs = [(kind, number) for kind, n in counts.items() for number in range(first, first + n)]
    results, failures, lock = collections.Counter(), [], threading.Lock()
    peaks = collections.Counter()

    def work(worker):
        base = Path(tempfile.mkdtemp(prefix="hostile-"))
        canary, child = Canary(base / "secret"), Child(base, longest_s)
        for kind, number in jobs[worker::n_workers]:
            answer = child.ask(kind, seed, number)
            if seen := canary.seen():
                answer["outside"] = [*answer.get("outside", []), *seen]
            verdict = judge(answer)
            with lock:
                results[kind, answer["outcome"]] += 1
                peaks[kind] = max(peaks[kind], answer.get("peak_mb", 0))
                if verdict:
                    failures.append({"kind": kind, "number": number, "verdict": verdict, **answer})
                    tell(json.dumps(failures[-1]))
        child.stop()
        shutil.rmtree(base, ignore_errors=True)

    threads = [threading.Thread(target=work, args=(worker,)) for worker in range(n_workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results, failures, peaks


def judge(answer):
    """What is wrong with an outcome; empty: nothing."""
    if answer["outcome"] not in ("taken", "refused"):
        return answer["outcome"]
    if answer["outside"]:
        return "outside"
    return "noise" if any(not KNOWN_NOISE.match(x) for x in answer["noise"].splitlines()) else ""


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for kind in KINDS:
        parser.add_argument(f"--{kind}", type=int, default=0, metavar="N")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--longest", type=float, default=5.0, help="seconds")
    args = parser.parse_args()
    counts = {kind: n for kind in KINDS if (n := getattr(args, kind))}
    results, failures, peaks = run(
        counts,
        args.seed,
        args.workers,
        args.longest,
        lambda line: print(line, flush=True),
        args.first,
    )
    for (kind, outcome), n in sorted(results.items()):
        print(f"{kind:12} {outcome:8} {n:7,}")
    for kind, peak in peaks.items():
        print(f"{kind:12} peak     {peak:7,} MB")
    print(f"seed {args.seed}: {sum(results.values()):,} inputs, {len(failures)} failures")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
