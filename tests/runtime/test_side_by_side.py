"""Films of several faces in a row."""

import io
import itertools

import av
import numpy as np
import pytest
from test_video import clip, pictures, sound

from facecode.errors import NoFacesError
from facecode.render.picture import Renderer
from facecode.writers.mp4 import (
    HIGHEST,
    PANEL,
    SOUND_RATE,
    WIDEST,
    arrangement,
    write_side_by_side,
)


def moving(amount, **changes):
    """A ball that grows to one side."""
    given = clip(6, **changes)
    given.offsets[:, :, 0] += amount * np.linspace(0, 1, 6)[:, None] * given.template[:, 0]
    return given


def test_each_panel_is_the_picture_of_its_clip(tmp_path):
    skins = [(200, 60, 60), (60, 160, 60), (60, 60, 200)]
    template = clip().template
    clips = [
        moving(0.3 * k, colours=np.full(template.shape, skin, np.uint8))
        for k, skin in enumerate(skins)
    ]
    path = tmp_path / "three.mp4"
    with path.open("wb") as file:
        write_side_by_side(clips, file)
    with av.open(path) as film:
        video, audio = film.streams.video[0], film.streams.audio[0]
        assert (video.width, video.height) == (3 * PANEL, PANEL)
        assert float(audio.duration * audio.time_base) == pytest.approx(6 / 30, abs=1e-3)
    shown = [picture for _, picture in pictures(path)]
    assert len(shown) == 6
    for (index, picture), (k, given) in itertools.product(enumerate(shown), enumerate(clips)):
        alone = Renderer(given.template, given.offsets, given.faces, given.colours, PANEL)
        panel = picture[:, k * PANEL : (k + 1) * PANEL].astype(int)
        error = np.abs(panel - alone.frame(index)).mean()
        assert error < 2, (index, k, error)  # of 255; chroma has half the resolution


def test_the_sound_is_that_of_the_first(tmp_path):
    path = tmp_path / "two.mp4"
    with path.open("wb") as file:
        write_side_by_side([moving(0), moving(0, audio=None, sample_rate=None)], file)
    samples, _ = sound(path)
    assert len(samples) / SOUND_RATE >= 6 / 30
    assert np.abs(samples).max() > 0.2


@pytest.mark.parametrize("clips", [[], [clip(6), clip(7)], [clip(6), clip(6, fps=25.0)]])
def test_clips_of_unlike_length_are_refused(clips):
    with pytest.raises(ValueError, match="one rate and number of frames"):
        write_side_by_side(clips, io.BytesIO())


def test_a_clip_without_faces_is_refused():
    with pytest.raises(NoFacesError):
        write_side_by_side([clip(6), clip(6, faces=None)], io.BytesIO())


def test_many_faces_stand_in_rows_that_decoders_take():
    assert arrangement(5) == (5, PANEL)
    assert arrangement(11) == (11, PANEL)
    for n in (1, 2, 5, 11, 12, 25, 26, 60, 100, 1000):
        n_columns, panel = arrangement(n)
        n_rows = -(-n // n_columns)
        assert panel % 2 == 0
        assert 0 < panel <= PANEL
        assert (n_columns * panel <= WIDEST, n_rows * panel <= HIGHEST) == (True, True)
        assert (n_rows - 1) * n_columns < n <= n_rows * n_columns


def test_rows_of_faces(tmp_path):
    path = tmp_path / "twelve.mp4"
    clips = [moving(0.02 * k) for k in range(13)]
    with path.open("wb") as file:
        write_side_by_side(clips, file)
    (_, shown), *_ = pictures(path)
    n_columns, panel = arrangement(13)
    assert shown.shape == (4 * panel, n_columns * panel, 3)
    last = clips[12]
    alone = Renderer(last.template, last.offsets, last.faces, last.colours, panel)
    assert np.abs(shown[3 * panel :, :panel].astype(int) - alone.frame(0)).mean() < 2
    nobody = shown[3 * panel :, panel : 2 * panel]
    assert np.ptp(nobody.astype(int), axis=2).max() < 40  # the grey behind the faces alone
