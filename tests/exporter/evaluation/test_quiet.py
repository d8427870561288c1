"""Noises have the level and the colour that they say, and open mouths and blinks are counted."""

import json

import numpy as np
import pytest
from conftest import TINY

from facecode_exporter.cli.main import main
from facecode_exporter.evaluation import quiet
from facecode_exporter.evaluation.quiet import (
    NOISES,
    Quiet,
    _blinks,
    judge_quiet,
    noise,
    quiet_table,
)

RATE = 16_000


@pytest.fixture
def few(monkeypatch):
    """One kind of noise at one level beside zeros, after a second of speech."""
    monkeypatch.setattr(quiet, "NOISES", {"hum": NOISES["hum"]})
    monkeypatch.setattr(quiet, "LEVELS_DB", (-30.0,))
    monkeypatch.setattr(quiet, "SPEECH_S", 1.0)


@pytest.mark.parametrize("kind", NOISES)
@pytest.mark.parametrize("level", [-60.0, -30.0])
def test_a_noise_has_its_level(kind, level):
    sound = noise(kind, level, 3 * RATE, RATE)
    assert 20 * np.log10(np.sqrt(np.square(sound.astype(float)).mean())) == pytest.approx(
        level, abs=0.01
    )
    assert np.array_equal(sound, noise(kind, level, 3 * RATE, RATE))
    assert not np.array_equal(sound, noise(kind, level, 3 * RATE, RATE, seed=1))


@pytest.mark.parametrize(("kind", "slope_db"), [("white", 0), ("pink", -3), ("brown", -6)])
def test_a_colour_falls_by_its_slope_an_octave(kind, slope_db):
    power = np.square(np.abs(np.fft.rfft(noise(kind, -30, 20 * RATE, RATE))))
    hz = np.fft.rfftfreq(20 * RATE, 1 / RATE)
    octaves = [power[(hz >= f) & (hz < 2 * f)].mean() for f in (250, 500, 1000, 2000)]
    assert np.diff(10 * np.log10(octaves)) == pytest.approx([slope_db] * 3, abs=0.5)


def test_blinks_are_counted_where_the_lid_falls():
    lids = np.zeros(300, np.float32)
    lids[10:14] = [0.4, 1, 0.8, 0.3]
    lids[100:103] = 0.4  # a squint
    lids[200:204] = 0.9
    assert _blinks(lids, 30.0) == pytest.approx(2 * 60 / 10)


@pytest.mark.parametrize("rest", [True, False])
def test_a_face_at_rest_is_still(few, tiny_faceformer, rest):
    """The gate leaves nothing of a face without eyelids; without it noise moves the mouth."""
    found = list(judge_quiet(tiny_faceformer, tiny_faceformer.styles[0], (3, 20), 2.0, rest, iter))
    assert [(q.kind, q.level_db) for q in found] == [("zeros", None), ("hum", -30.0)]
    zeros = found[0]
    assert 0 <= zeros.open_share <= 1
    if rest:
        assert zeros.open_share == 0
    assert quiet_table(found).count("\n") == len(found)


def test_the_command(few, capsys):
    args = ["evaluate", "quiet", "--bundle", TINY, "--lip-pair", "3,20", "--seconds", "1.5"]
    assert main([*map(str, args), "--quiet", "--json", "-"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["seconds"] == 1.5
    assert [set(each) for each in told["quiet"]] == [set(Quiet.__dataclass_fields__)] * 2
    for more, message in (([], "more than 1"), (["--style", "x"], "this bundle has a, b, c")):
        code = main([*map(str, args[:-1]), "0.5" if not more else "2", *more, "--quiet"])
        out, err = capsys.readouterr()
        assert (code, out) == (2, "")
        assert message in err
