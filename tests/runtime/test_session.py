"""Threads and execution providers: what is asked for is what runs, or an error."""

import pytest
from conftest import TINY

import facecode
from facecode import Compute
from facecode.errors import ProviderError
from facecode.session import CPU, usable_cores


def test_compute_is_a_value():
    assert Compute() == Compute(usable_cores(), "cpu")
    assert Compute(2).provider == CPU
    assert Compute(2, "CUDA").provider == "CUDAExecutionProvider"
    for threads in (0, -1):
        with pytest.raises(ValueError, match="at least 1"):
            Compute(threads)


def test_threads_are_short_for_compute():
    assert facecode.load(TINY, threads=1).compute == Compute(1)
    assert facecode.load(TINY, compute=Compute(3)).compute.n_threads == 3
    with pytest.raises(ValueError, match="beside compute"):
        facecode.load(TINY, threads=1, compute=Compute(1))


def test_a_missing_provider_is_an_error_that_names_those_there_are():
    with pytest.raises(ProviderError, match=r"has no CUDAExecutionProvider; it has .*CPU"):
        facecode.load(TINY, compute=Compute(1, "CUDA"))


def test_a_provider_that_does_not_start_is_an_error(monkeypatch):
    """onnxruntime falls back to the CPU without a word; facecode does not."""
    import onnxruntime

    monkeypatch.setattr(
        onnxruntime, "get_available_providers", lambda: ["CUDAExecutionProvider", CPU]
    )
    with pytest.raises(facecode.FacecodeError):
        facecode.load(TINY, compute=Compute(1, "CUDA"))


def test_command_line(run_cli):
    done = run_cli("bench", TINY, "--provider", "Nonesuch", "--seconds", "1")
    assert done.returncode == 2
    assert "has no NonesuchExecutionProvider" in done.stderr
    assert "Traceback" not in done.stderr
    assert "CPUExecutionProvider" in run_cli("info", TINY).stdout
