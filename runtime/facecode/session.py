"""onnxruntime sessions: options in one place, calls by tensor name.

The only module that imports onnxruntime, and only when the first graph is loaded.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from facecode.arrays import AnyArray
from facecode.errors import GraphError, ProviderError, ThreadsError
from facecode_spec.entries import GraphEntry

if TYPE_CHECKING:
    import onnxruntime as ort

CPU = "CPUExecutionProvider"
MOST_THREADS = 256
"""Of a graph. Threads spin while they wait: thousands would starve the machine."""


@dataclass(frozen=True)
class Compute:
    """How graphs are run: threads, and onnxruntime's execution provider with its options."""

    threads: int | None = None
    """None: as many as this process may use at once; see `usable_cores`."""
    provider: str = CPU
    """Its name in onnxruntime; a short form without `ExecutionProvider` will do."""
    options: Mapping[str, str] = field(default_factory=dict)
    """Of the provider, as onnxruntime names them."""

    def __post_init__(self) -> None:
        threads = usable_cores() if self.threads is None else self.threads
        if not 1 <= threads <= MOST_THREADS:
            raise ThreadsError(
                f"got {threads} threads; expected 1 to {MOST_THREADS}, best no more than the cores"
            )
        object.__setattr__(self, "threads", threads)
        object.__setattr__(self, "provider", _provider_name(self.provider))

    @property
    def n_threads(self) -> int:
        """The number of threads, whether it was given or found."""
        return self.threads or 1


def usable_cores() -> int:
    """Cores that this process may use: its affinity, its container's quota, OMP_NUM_THREADS."""
    if hasattr(os, "sched_getaffinity"):
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    asked = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    if asked.isdecimal() and int(asked):
        cores = min(cores, int(asked))
    return min(cores, MOST_THREADS, container_cores())


def container_cores(root: Path = Path("/sys/fs/cgroup")) -> int:
    """The quota of this process's container in whole cores, at least 1 (cgroup 2, then 1)."""
    for quota_file, period_file in (("cpu.max",) * 2, ("cpu.cfs_quota_us", "cpu.cfs_period_us")):
        folder = root if quota_file == "cpu.max" else root / "cpu"
        try:
            quota = (folder / quota_file).read_text().split()[0]
            period = (folder / period_file).read_text().split()[-1]
            if int(quota) > 0 and int(period) > 0:
                return max(1, int(quota) // int(period))
        except (OSError, ValueError, IndexError):  # no such file, or `max`
            continue
    return MOST_THREADS


def onnxruntime_version() -> str:
    """The version of the installed onnxruntime, whichever distribution brought it."""
    import onnxruntime

    return str(onnxruntime.__version__)


def available_providers() -> tuple[str, ...]:
    """Execution providers that the installed onnxruntime has."""
    import onnxruntime

    return tuple(onnxruntime.get_available_providers())


def _provider_name(name: str) -> str:
    """onnxruntime's full name of a provider."""
    if name.casefold() == "cpu":
        return CPU
    return name if name.endswith("ExecutionProvider") else f"{name}ExecutionProvider"


def session_options(compute: Compute) -> ort.SessionOptions:
    """The options of every session; see docs/performance.md for the measurements."""
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.intra_op_num_threads = compute.n_threads
    # The graphs are chains: nothing to run side by side.
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.inter_op_num_threads = 1
    # A call is some hundred short operators: waking a sleeping thread for each takes longer than
    # many of them. Between calls threads sleep, since the pools of four sessions share the cores.
    options.add_session_config_entry("session.intra_op.allow_spinning", "1")
    options.add_session_config_entry("session.force_spinning_stop", "1")
    # Patterns are recorded per input shape, and the prefix has a new one at every step.
    options.enable_mem_pattern = False
    # Without VNNI the fast product of u8 by s8 adds pairs in 16 bits and saturates: on such
    # processors onnxruntime then takes a slower product that is right. Nothing changes elsewhere.
    options.add_session_config_entry("session.x64quantprecision", "1")
    options.log_severity_level = 4  # fatal alone: errors come as exceptions
    return options


class Graph:
    """One graph of a bundle, checked against the signature that its manifest states."""

    def __init__(self, path: Path, entry: GraphEntry, compute: Compute) -> None:
        """Load a graph.

        Raises:
            ProviderError: onnxruntime lacks the provider, or the provider refuses to start.
            GraphError: onnxruntime cannot load the file, or it has another signature.
        """
        self.name = path.stem
        self._session = _session(path, compute)
        self._check_names(entry)

    def _check_names(self, entry: GraphEntry) -> None:
        for kind, nodes, stated in (
            ("inputs", self._session.get_inputs(), entry.inputs),
            ("outputs", self._session.get_outputs(), entry.outputs),
        ):
            found, expected = [n.name for n in nodes], [t.name for t in stated]
            if found != expected:
                raise GraphError(
                    f"{entry.path} has the {kind} {found}, but its manifest says {expected}; "
                    "export the bundle again"
                )

    def run(self, outputs: Sequence[str], **inputs: AnyArray) -> list[AnyArray]:
        """The named outputs for the named inputs.

        Raises:
            GraphError: onnxruntime refuses the inputs, or runs out of memory.
        """
        try:
            return self._session.run(list(outputs), inputs)  # type: ignore[no-any-return]
        except Exception as error:
            raise GraphError(f"{self.name} failed: {error}") from error


def _session(path: Path, compute: Compute) -> ort.InferenceSession:
    """A session on the wanted provider; onnxruntime itself would fall back to the CPU silently."""
    import onnxruntime as ort

    if compute.provider not in ort.get_available_providers():
        raise ProviderError(
            f"onnxruntime {ort.__version__} here has no {compute.provider}; it has "
            f"{', '.join(ort.get_available_providers())}. Install the onnxruntime package that "
            "brings it in place of onnxruntime, or leave the provider out"
        )
    wanted = [(compute.provider, dict(compute.options))]
    try:
        session = ort.InferenceSession(os.fspath(path), session_options(compute), providers=wanted)
    except Exception as error:  # onnxruntime's exceptions share no public base
        raise GraphError(f"onnxruntime cannot load {path.name}: {error}") from error
    if session.get_providers()[0] != compute.provider:
        raise ProviderError(
            f"{compute.provider} did not start for {path.name}; onnxruntime would run it on "
            f"{session.get_providers()[0]}. Check the provider's drivers and libraries"
        )
    return session
