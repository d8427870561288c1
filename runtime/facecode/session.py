"""onnxruntime sessions: options in one place, calls by tensor name.

The only module that imports onnxruntime.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import onnxruntime as ort

from facecode.arrays import AnyArray
from facecode.errors import GraphError
from facecode_spec.manifest import GraphEntry

ONNXRUNTIME_VERSION: str = ort.__version__


def default_threads() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def session_options(threads: int) -> ort.SessionOptions:
    """The options of every session; see docs/performance.md for the measurements."""
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    # The graphs are chains: nothing to run side by side.
    options.execution_mode = ort.ExecutionMode.ORT_SEQUENTIAL
    options.inter_op_num_threads = 1
    # A call is some hundred short operators: waking a sleeping thread for each takes longer than
    # many of them. Between calls threads sleep, since the pools of four sessions share the cores.
    options.add_session_config_entry("session.intra_op.allow_spinning", "1")
    options.add_session_config_entry("session.force_spinning_stop", "1")
    # Patterns are recorded per input shape, and the prefix has a new one at every step.
    options.enable_mem_pattern = False
    options.log_severity_level = 3  # errors; they also come as exceptions
    return options


class Graph:
    """One graph of a bundle, checked against the signature that its manifest states."""

    def __init__(self, path: Path, entry: GraphEntry, threads: int) -> None:
        self.name = path.stem
        try:
            self._session = ort.InferenceSession(
                os.fspath(path), session_options(threads), providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's exceptions share no public base
            raise GraphError(f"onnxruntime cannot load {path.name}: {error}") from error
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
