"""`facecode-export evaluate live`: streams against whole recordings, kept in the bundle."""

import dataclasses
import json
from typing import NamedTuple

import numpy as np
import pytest
import soundfile
from conftest import TINY

import facecode
from facecode.bundle import Bundle, read_manifest
from facecode.cli.info import summary
from facecode_exporter.cli.main import main
from facecode_exporter.data import recordings


class Phone(NamedTuple):
    name: str
    start_s: float
    end_s: float


PHONES = [Phone("SIL", 0, 0.4), Phone("M", 0.4, 0.5), Phone("AA", 0.5, 0.9), Phone("SIL", 0.9, 1)]


class FakeAligner:
    def align(self, _audio, _text):
        return PHONES


@pytest.fixture
def recorded(tmp_path, speech, monkeypatch):
    monkeypatch.setattr(recordings, "load_aligner", FakeAligner)
    folder = tmp_path / "recorded"
    folder.mkdir()
    samples, rate = speech
    for i, name in enumerate(("one", "two")):
        soundfile.write(folder / f"{name}.wav", samples[i * rate : (i + 1) * rate], rate)
        (folder / f"{name}.txt").write_text("mama")
    return folder


def run(capsys, *args):
    code = main(["evaluate", "live", *map(str, args), "--quiet"])
    return code, *capsys.readouterr()


def test_numbers_are_kept_in_the_bundle(recorded, tiny_copy, capsys):
    args = [recorded, "--bundle", tiny_copy, "--lip-pair", "3,20", "--block", 0.2, "--json", "-"]
    code, out, err = run(capsys, *args, "--store")
    assert (code, err) == (0, "")
    numbers = json.loads(out)
    before, bundle = read_manifest(TINY), Bundle.open(tiny_copy)  # which verifies every file
    live = bundle.manifest.live
    assert numbers["measured"]["exact"]["closures"] == {
        "n": 2,
        "met": live.measured.exact.closures.met,
    }
    assert (live.block_s, live.context_s, live.look_ahead_ms, live.primer) == (
        0.2, 1.0, 200.0, "primer.npy"
    )  # fmt: skip
    assert [each.look_ahead_ms for each in live.measured.look_aheads] == [100, 200, 400]
    for each, told in zip(
        live.measured.look_aheads, numbers["measured"]["look_aheads"], strict=True
    ):
        assert -1 <= each.opening_r <= 1
        assert told["opening_r"] == each.opening_r
        assert each.acceleration_ratio > 0
        assert (each.lips.closures.n, each.lips.openings.n) == (2, 2)
    files = {name: entry for name, entry in bundle.manifest.files.items() if name != "primer.npy"}
    assert files == before.files
    assert dataclasses.replace(bundle.manifest, live=None, files=files) == before
    assert "200 ms" in summary(bundle)
    assert facecode.load(bundle.root, threads=1).stream().plan.block == 6
    assert not list(tiny_copy.glob(".live*"))


def test_r_and_acceleration_are_of_all_frames(recorded, tiny_copy, capsys):
    code, out, _ = run(capsys, recorded, "--bundle", tiny_copy, "--lip-pair", "3,20", "--json", "-")
    told = {each["look_ahead_ms"]: each for each in json.loads(out)["measured"]["look_aheads"]}
    assert code == 0
    assert read_manifest(tiny_copy).live is None  # nothing was stored
    face, openings, fast = facecode.load(TINY, threads=1), [], []
    for how in ({"mode": "exact"}, {"mode": "live", "look_ahead_ms": 400}):
        clips = [face.animate(recorded / f"{name}.wav", **how) for name in ("one", "two")]
        gaps = [np.linalg.norm(c.vertices[:, 3] - c.vertices[:, 20], axis=1) for c in clips]
        openings.append(np.concatenate(gaps))
        second = [np.diff(c.vertices.astype(float), 2, axis=0) for c in clips]
        rms = [np.sqrt(np.square(x).sum(axis=2).mean(axis=1)) for x in second]
        fast.append(np.percentile(np.concatenate(rms), 99))
    assert told[400]["opening_r"] == pytest.approx(np.corrcoef(*openings)[0, 1], abs=1e-5)
    assert told[400]["acceleration_ratio"] == pytest.approx(fast[1] / fast[0], rel=1e-4)


def test_the_table(recorded, tiny_copy, capsys):
    code, out, _ = run(capsys, recorded, "--bundle", tiny_copy, "--lip-pair", "3,20")
    assert code == 0
    assert "context 1000 ms, block 100 ms, shown 1 frames late" in out
    starts = ["look-ahead", "100 ms", "200 ms", "400 ms", "whole recording"]
    for line, start in zip(out.splitlines()[1:], starts, strict=True):
        assert line.startswith(start)


def test_mistakes_are_one_line(recorded, tiny_copy, capsys):
    pair = ["--lip-pair", "3,20"]
    for args, message in (
        ([recorded, "--bundle", TINY], "names no lip pair"),
        ([recorded, "--bundle", TINY, *pair, "--style", "x"], "this bundle has a, b, c"),
        ([recorded, "--bundle", TINY, *pair, "--context", 31], "up to 30 s"),
        ([recorded / "no", "--bundle", TINY, *pair], "is no folder"),
    ):
        code, out, err = run(capsys, *args)
        assert (code, out) == (2, ""), args
        assert message in err
        assert err.count("\n") == 1


def test_a_bundle_that_cannot_be_written_stays_as_it_was(recorded, tiny_copy, capsys, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "save", full)
    before = (tiny_copy / "manifest.json").read_bytes()
    code, _, err = run(capsys, recorded, "--bundle", tiny_copy, "--lip-pair", "3,20", "--store")
    assert code == 2
    assert "No space left" in err
    assert (tiny_copy / "manifest.json").read_bytes() == before
    Bundle.open(tiny_copy)
