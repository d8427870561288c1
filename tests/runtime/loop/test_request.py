"""Styles, modes, samples and options, checked before the work begins."""

import numpy as np
import pytest

from facecode.cli.options import parse_samples
from facecode.errors import ModeError, SampleError, StyleError, StyleWarning
from facecode.loop.request import Window, style_weights, window_of
from facecode.options import parse_style
from facecode_spec.manifest import ModeEntry

NAMES = ("calm", "lively", "FaceTalk_170728_03272_TA")
MODES = {
    "exact": ModeEntry(None, None),
    "window": ModeEntry(None, delay_frames=30, window=7),
}


def test_styles():
    assert style_weights(None, NAMES).tolist() == [1, 0, 0]
    assert style_weights("lively", NAMES).tolist() == [0, 1, 0]
    mixed = style_weights(parse_style("calm:0.25, lively:0.75"), NAMES)
    assert mixed.tolist() == [0.25, 0.75, 0]
    assert mixed.dtype == np.float32


def test_unknown_style_names_the_nearest():
    with pytest.raises(StyleError, match="no style 'clam'; nearest: calm"):
        style_weights("clam", NAMES)
    with pytest.raises(StyleError, match="nearest: FaceTalk_170728_03272_TA"):
        style_weights("facetalk_170728_03272", NAMES)


@pytest.mark.parametrize("text", ["calm:x", "calm:0.5,lively", ":"])
def test_unreadable_mix(text):
    with pytest.raises(StyleError, match=r"a:0\.3,b:0\.7"):
        parse_style(text)


@pytest.mark.parametrize("mix", [{}, {"calm": float("nan")}, {"calm": "1"}])
def test_mix_that_is_none(mix):
    with pytest.raises(StyleError):
        style_weights(mix, NAMES)


def test_mix_that_does_not_sum_to_one_is_used_and_said():
    with pytest.warns(StyleWarning, match="sum to 1.5"):
        assert style_weights({"calm": 1, "lively": 0.5}, NAMES).tolist() == [1, 0.5, 0]


def test_window_of_a_mode():
    assert window_of("exact", None, MODES, 3) is None
    assert window_of(None, None, MODES, 3) is None  # the bundle's first
    assert window_of("window", 5, MODES, 3) == Window(5, 30)
    assert window_of("window", None, MODES, 3) == Window(7, 30)
    for mode, window in (("exact", 5), ("window", 2), ("fast", None)):
        with pytest.raises(ModeError):
            window_of(mode, window, MODES, 3)
    with pytest.raises(ModeError, match="one mode for recordings, exact: leave mode"):
        window_of("window", None, {"exact": MODES["exact"]}, 3)


def test_options_that_are_not_known_are_refused(tiny, speech):
    with pytest.raises(TypeError, match=r"animate\(\) got an unexpected argument 'stile'"):
        tiny.animate(speech[0], stile="a")


def test_samples_of_the_command_line():
    none = {"lips": None, "upper_face": None}
    assert parse_samples([], none) is None
    assert parse_samples(["5"], none) == 5
    assert parse_samples(["jaw=2", "brows=3"], none) == {"jaw": 2, "brows": 3}
    assert parse_samples([], {"lips": 2, "upper_face": None}) == {"lips": 2}
    for texts in (["0"], ["jaw="], ["=2"], ["x"], ["jaw=2", "5"]):
        with pytest.raises(SampleError):
            parse_samples(texts, none)


def test_a_bundle_of_one_sample_names_one_of_several(tiny, speech):
    with pytest.raises(SampleError, match="bundle 'diverse' gives 5"):
        tiny.animate(speech[0], samples=3)
