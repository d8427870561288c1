"""Threads and execution providers: what is asked for is what runs, or an error."""

import pytest
from conftest import TINY

import facecode
from facecode import Compute
from facecode.errors import ProviderError
from facecode.session import CPU, MOST_THREADS, container_cores, usable_cores


def test_compute_is_a_value():
    assert Compute() == Compute(usable_cores(), "cpu")
    assert Compute(2).provider == CPU
    assert Compute(2, "CUDA").provider == "CUDAExecutionProvider"
    for threads in (0, -1, 5000):
        with pytest.raises(ValueError, match="expected 1 to 256"):
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


@pytest.mark.parametrize(
    ("files", "cores"),
    [
        ({"cpu.max": "100000 100000"}, 1),
        ({"cpu.max": "250000 100000"}, 2),
        ({"cpu.max": "20000 100000"}, 1),
        ({"cpu.max": "max 100000"}, MOST_THREADS),
        ({"cpu.max": "rubbish"}, MOST_THREADS),
        ({"cpu/cpu.cfs_quota_us": "400000", "cpu/cpu.cfs_period_us": "100000"}, 4),
        ({"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"}, MOST_THREADS),
        ({}, MOST_THREADS),
    ],
)
def test_a_containers_quota(tmp_path, files, cores):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text + "\n")
    assert container_cores(tmp_path, tmp_path / "none") == cores


@pytest.mark.parametrize(
    ("line", "cores"),
    [("0::/a/b\n", 1), ("12:cpu:/x\n0::/a\n", 3), ("0::/\n", 8), ("0::/a/c\n", 3), ("0::/../x", 8)],
)
def test_the_least_quota_of_the_groups_around(tmp_path, line, cores):
    """As systemd sets them: a slice of three cores, a service of one in it, on a host of eight."""
    (tmp_path / "a/b").mkdir(parents=True)
    (tmp_path / "own").write_text(line)
    for folder, quota in ((".", 800_000), ("a", 300_000), ("a/b", 100_000)):
        (tmp_path / folder / "cpu.max").write_text(f"{quota} 100000\n")
    assert container_cores(tmp_path, tmp_path / "own") == cores


@pytest.mark.parametrize(("asked", "at_most"), [("1", 1), ("1,2", 1), ("", None), ("x", None)])
def test_the_number_that_openmp_may_use(monkeypatch, asked, at_most):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    free = usable_cores()
    monkeypatch.setenv("OMP_NUM_THREADS", asked)
    assert usable_cores() == (at_most or free)
