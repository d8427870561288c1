"""What of a batch is done, on disk: it can be stopped anywhere and goes on where it was.

`.batch/plan.json` says which batch the folder holds; `.batch/N.json`, written after the results of
portion N, that they are there. `failures.jsonl` is written when all is done.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from facecode import writers
from facecode.corpus.job import Failure, Job, Outcome, Portion
from facecode.errors import OtherBatchError, OutputFolderError, OutputWriteError

FAILURES = "failures.jsonl"


def open_ledger(job: Job, portions: Sequence[Portion], manifest: str) -> Path:
    """The ledger's folder, begun if it is not there.

    Raises:
        OtherBatchError: the folder holds another batch.
        OutputFolderError, OutputWriteError: it cannot be made.
    """
    folder = job.out / ".batch"
    try:
        job.out.mkdir(exist_ok=True)
        folder.mkdir(exist_ok=True)
    except FileNotFoundError as error:
        raise OutputFolderError(
            f"the folder {job.out.parent} does not exist; create it first"
        ) from error
    except OSError as error:
        raise OutputWriteError(f"cannot make the folder {job.out}: {error.strerror}") from error
    plan, file = _plan(job, portions, manifest), folder / "plan.json"
    if not file.exists():
        _write(file, plan)
    elif (held := json.loads(file.read_text())) != plan:
        differing = ", ".join(key for key in plan if plan[key] != held.get(key))
        raise OtherBatchError(
            f"{job.out} holds another batch: {differing} differ; name another folder, or ask for "
            "what was asked for when it was begun"
        )
    for left in job.out.rglob(".facecode-*"):  # of a process that was killed as it wrote
        left.unlink(missing_ok=True)
    return folder


def _plan(job: Job, portions: Sequence[Portion], manifest: str) -> dict[str, object]:
    named = [(r.id, r.size, r.style, r.template) for p in portions for r in p.recordings]
    asked = {k: v for k, v in job.options.items() if v is not None and (k, v) != ("mode", "auto")}
    options = (job.style, sorted(asked.items(), key=str), job.offsets)
    return {
        "recordings": _digest(named),
        "n_recordings": len(named),
        "format": job.format,
        "bundle": _digest(manifest),
        "options": _digest(options),
    }


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()


def done(folder: Path) -> dict[int, Outcome]:
    """The portions that are done, by number."""
    outcomes = (_read(file) for file in folder.glob("[0-9]*.json"))
    return {outcome.number: outcome for outcome in outcomes}


def _read(file: Path) -> Outcome:
    plain = json.loads(file.read_text())
    failures = tuple(Failure(**failure) for failure in plain.pop("failures"))
    return Outcome(**plain, failures=failures)


def note(job: Job, outcome: Outcome) -> None:
    """Say that the results of a portion are there."""
    _write(job.out / ".batch" / f"{outcome.number:06d}.json", dataclasses.asdict(outcome))


def write_failures(out: Path, failures: Iterable[Failure]) -> None:
    """All that failed, one a line, by name; an empty file says that nothing did."""
    lines = [json.dumps(dataclasses.asdict(f)) for f in sorted(failures, key=lambda f: f.id)]
    with writers.writing(out / FAILURES) as file:
        file.write("".join(f"{line}\n" for line in lines).encode())


def _write(path: Path, value: object) -> None:
    with writers.writing(path) as file:
        file.write(json.dumps(value).encode())
