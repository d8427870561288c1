"""`bench-reference`: the public algorithm and the runtime in one run."""

import json

import pytest
from conftest import TINY

from facecode_exporter.cli.main import main


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    out = tmp_path_factory.mktemp("init") / "checkpoints"
    assert main(["init", "--system", "codetalker-tiny", "--out", str(out)]) == 0
    return ["--stage1", str(out / "stage1.pth.tar"), "--stage2", str(out / "stage2.pth.tar")]


def test_table_and_json(checkpoints, tmp_path, capsys):
    args = ["bench-reference", str(TINY), str(TINY), *checkpoints, "--threads", "1", "--quiet"]
    report = tmp_path / "report.json"
    args += ["--seconds", "1,0.5", "--rounds", "1", "--window", "6"]
    assert main([*args, "--json", str(report)]) == 0
    out = capsys.readouterr().out
    assert "public algorithm" in out
    assert "codetalker-tiny fp32 exact" in out
    assert "a full run of 0.5 s takes" in out
    numbers = json.loads(report.read_text())
    assert [r["seconds"] for r in numbers["reference"]] == [0.5, 1.0]
    assert [r["n_frames"] for r in numbers["reference"]] == [14, 29]
    assert numbers["reference"][0]["full_run_ms_per_frame"] > 0
    assert numbers["reference"][1]["full_run_ms_per_frame"] is None
    assert len(numbers["runtime"]) == 2 * 2 * 2
    assert {r["window"] for r in numbers["runtime"]} == {None, 6}
    for r in numbers["runtime"]:
        truth = next(t for t in numbers["reference"] if t["seconds"] == r["seconds"])
        assert r["ratio"] == pytest.approx(truth["ms_per_frame"] / r["ms_per_frame"])


@pytest.mark.parametrize("wrong", [["--seconds", "0"], ["--modes", "quick"]])
def test_mistakes_exit_2(checkpoints, wrong):
    with pytest.raises(SystemExit) as exit_:
        main(["bench-reference", str(TINY), *checkpoints, *wrong])
    assert exit_.value.code == 2
