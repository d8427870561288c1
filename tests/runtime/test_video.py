"""Films: what the file holds, that picture and sound agree, and what happens when they cannot."""

import dataclasses
import itertools
import os
import subprocess
import sys
import time
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import soundfile
from conftest import SPEECH, TINY

import facecode
from facecode import writers
from facecode.animation import Animation
from facecode.bundle import Bundle
from facecode.cli import main
from facecode.errors import MissingExtraError, NoFacesError, OutputWriteError
from facecode.render import raster
from facecode.render.picture import Renderer
from facecode.render.surface import vertex_normals
from facecode.writers.format import Format
from facecode.writers.mp4 import SIZE, SOUND_RATE


def ball(n_rings=12):
    """A sphere of radius 1: vertices (V, 3), faces (F, 3) counter-clockwise from outside."""
    rows, columns = n_rings + 1, 2 * n_rings
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rows), np.arange(columns) * np.pi / n_rings, indexing="ij"
    )
    xyz = [np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)]
    i, j = np.meshgrid(np.arange(n_rings), np.arange(columns), indexing="ij")
    a, b = i * columns + j, i * columns + (j + 1) % columns
    quads = np.stack([a, a + columns, b + columns, b], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return np.stack(xyz, axis=-1).reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def clip(n_frames=12, fps=30.0, seconds=None, rate=16000, moved=None, n_rings=12, **changes):
    """A ball, with sound of `seconds` (as long as the picture by default)."""
    template, faces = ball(n_rings)
    offsets = np.zeros((n_frames, *template.shape), np.float32)
    if moved is not None:
        offsets += moved[:, None, :]
    n_samples = round((n_frames / fps if seconds is None else seconds) * rate)
    tone = 0.3 * np.sin(np.arange(n_samples) * 2 * np.pi * 220 / rate).astype(np.float32)
    codes = np.zeros((n_frames, 4), np.int64)
    given = {"faces": faces, "colours": None, "audio": tone, "sample_rate": rate} | changes
    return Animation(offsets, codes, fps, template, **given)


def pictures(path):
    with av.open(path) as film:
        return [(float(f.time), f.to_ndarray(format="rgb24")) for f in film.decode(video=0)]


def sound(path):
    """(samples, start in seconds)"""
    with av.open(path) as film:
        blocks = list(film.decode(audio=0))
    return np.concatenate([b.to_ndarray()[0] for b in blocks]), float(blocks[0].time)


@pytest.mark.parametrize(
    ("n_frames", "fps", "seconds", "rate"),
    [
        (12, 30.0, None, 16000),
        (12, 25.0, 0.9, 16000),  # more sound than picture
        (12, 25.0, 0.1, 16000),  # less
        (15, 29.97, None, 22050),
        (12, 60.0, None, 11025),
        (1, 30.0, None, 16000),
    ],
)
def test_what_a_film_holds(tmp_path, n_frames, fps, seconds, rate):
    path = tmp_path / "talk.mp4"
    clip(n_frames, fps, seconds, rate).save(path)
    with av.open(path) as film:
        video, audio = film.streams.video[0], film.streams.audio[0]
        assert (video.codec_context.name, audio.codec_context.name) == ("h264", "aac")
        assert (video.pix_fmt, video.width, video.height) == ("yuv420p", SIZE, SIZE)
        assert (audio.rate, audio.channels) == (SOUND_RATE, 1)
        assert video.average_rate == pytest.approx(Fraction(fps).limit_denominator(1001))
        lengths = [float(s.duration * s.time_base) for s in (video, audio)]
    assert lengths == pytest.approx([n_frames / fps] * 2, abs=1 / 1000)
    times = [t for t, _ in pictures(path)]
    assert times == pytest.approx(np.arange(n_frames) / fps, abs=1e-3)
    # What decodes may hold the rest of the encoder's last block: 21 ms.
    samples, start = sound(path)
    assert start == 0
    assert 0 <= len(samples) / SOUND_RATE - n_frames / fps < 1024 / SOUND_RATE
    assert path.read_bytes().index(b"moov") < path.read_bytes().index(b"mdat")  # starts at once


@pytest.mark.parametrize(("at", "fps"), [(20, 30.0), (7, 25.0)])
def test_picture_and_sound_agree(tmp_path, at, fps):
    """The ball jumps while the sound clicks: both are found within a frame of where they were."""
    n_frames, rate = 30, 16000
    moved = np.zeros((n_frames, 3), np.float32)
    moved[at:, 0] = 1
    click = np.zeros(round(n_frames / fps * rate), np.float32)
    click[round(at / fps * rate) :][:32] = 0.9
    path = tmp_path / "talk.mp4"
    clip(n_frames, fps, moved=moved, audio=click, sample_rate=rate).save(path)
    seen = pictures(path)
    change = [np.abs(b[1].astype(int) - a[1]).mean() for a, b in itertools.pairwise(seen)]
    jump_s = seen[int(np.argmax(change)) + 1][0]
    samples, start = sound(path)
    click_s = start + np.argmax(np.abs(samples)) / SOUND_RATE
    print(f"\njump at {1e3 * jump_s:.1f} ms, click at {1e3 * click_s:.1f} ms")
    assert jump_s == pytest.approx(at / fps, abs=1e-3)
    assert click_s == pytest.approx(jump_s, abs=0.1 / fps)  # measured 1 ms


def test_without_audio_the_film_is_silent(tmp_path):
    path = tmp_path / "talk.mp4"
    clip(audio=None, sample_rate=None).save(path)
    with av.open(path) as film:
        assert [s.type for s in film.streams] == ["video"]
    assert len(pictures(path)) == 12


def test_colours_are_shown_and_clay_without(tmp_path):
    template, _ = ball()
    skins = {"red": (200, 40, 40), "blue": (40, 40, 200), "clay": None}
    middle = {}
    for name, skin in skins.items():
        colours = None if skin is None else np.full(template.shape, skin, np.uint8)
        clip(2, colours=colours).save(tmp_path / f"{name}.mp4")
        middle[name] = pictures(tmp_path / f"{name}.mp4")[0][1][260:380, 260:380].mean(axis=(0, 1))
    assert middle["red"][0] > 2 * middle["red"][2]
    assert middle["blue"][2] > 2 * middle["blue"][0]
    assert middle["clay"].max() < 1.4 * middle["clay"].min()
    assert middle["clay"].min() > 90


@pytest.mark.parametrize("size", [(64, 64), (37, 51), (1, 1)])
def test_the_rasteriser_agrees_with_a_test_of_every_sample(size):
    """Against inclusion and depth by barycentric coordinates, in float64, on random triangles."""
    rng = np.random.default_rng(3)
    height, width = size
    screen = rng.uniform(-0.3, 1.3, (3, 40)).astype(np.float32)
    screen[:2] *= [[width], [height]]
    screen[2] += 1
    faces = rng.integers(0, 40, (60, 3)).astype(np.int32)  # some have a corner twice
    keys = raster.draw(screen, faces, size)
    y, x = (v.ravel() + 0.5 for v in np.mgrid[:height, :width])
    best, winner = np.zeros(height * width), np.full(height * width, -1)
    for index, (a, b, c) in enumerate(screen.T[faces].astype(np.float64)):
        area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
        if area == 0:
            continue
        v = ((x - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (y - a[1])) / area
        w = ((b[0] - a[0]) * (y - a[1]) - (x - a[0]) * (b[1] - a[1])) / area
        near = a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2])
        wins = (v >= 0) & (w >= 0) & (v + w <= 1) & (near > best)
        best[wins], winner[wins] = near[wins], index
    drawn = np.where(keys > 0, raster.triangle_of(keys), -1)
    assert (drawn != winner).mean() < 2e-3  # samples on an edge, to float32
    same = (drawn == winner) & (winner >= 0)
    np.testing.assert_allclose(raster.nearness_of(keys)[same], best[same], rtol=1e-4)


def test_a_closed_surface_has_no_cracks():
    template, faces = ball(40)
    size = 301
    screen = np.stack(
        [template[:, 0] * 140 + 150.3, template[:, 1] * 140 + 150.7, template[:, 2] + 3]
    )
    keys = raster.draw(screen.astype(np.float32), faces, (size, size)).reshape(size, size)
    y, x = np.mgrid[:size, :size] + 0.5
    inside = (x - 150.3) ** 2 + (y - 150.7) ** 2 < 139**2
    assert (keys[inside] > 0).all()
    front = template[faces[raster.triangle_of(keys[inside])]].mean(axis=1)
    assert (front[:, 2] > -0.05).all()  # the near side hides the far one


def test_normals_point_outwards():
    template, faces = ball()
    normals = vertex_normals(template, faces)
    used = np.unique(faces)
    assert (np.einsum("vi,vi->v", normals, template)[used] > 0.9).sum() >= len(used) - 48  # poles


def test_turned_triangles_look_the_same():
    """Triangles that go round the other way are turned."""
    one, other = clip(1), clip(1, faces=ball()[1][:, ::-1].copy())
    shown = [Renderer(c.template, c.offsets, c.faces, None, 128).frame(0) for c in (one, other)]
    assert np.abs(shown[0].astype(int) - shown[1]).mean() < 0.5


def test_odd_meshes_are_drawn():
    """No movement at all, one point, a vertex that is not finite, two triangles."""
    template, faces = ball()
    broken = template.copy()
    broken[np.argmax(template[:, 2])] = np.nan  # in the middle of the picture
    meshes = [
        (template * 0, faces),
        (broken, faces),
        (template, faces[:2]),
        (template * 1e4, faces),
    ]
    for vertices, triangles in meshes:
        still = np.zeros((2, *vertices.shape), np.float32)
        shown = Renderer(vertices, still, triangles, None, 96).frame(1)
        assert shown.shape == (96, 96, 3)


def test_odd_sizes_are_drawn():
    given = clip(2)
    for size in (1, 33, 101):
        shown = Renderer(given.template, given.offsets, given.faces, None, size).frame(0)
        assert shown.shape == (size, size, 3)


def test_speed_on_a_head_sized_mesh():
    """23 frames per second of processor time on a head; the bar is for slow and busy machines."""
    given = clip(8, n_rings=49)
    assert 4700 < len(given.template) < 5000
    renderer = Renderer(given.template, given.offsets, given.faces, given.colours, SIZE)
    start = time.process_time()
    for index in range(8):
        renderer.frame(index)
    rate = 8 / (time.process_time() - start)
    print(f"\n{rate:.1f} frames per CPU second, {len(given.faces):,} triangles")
    assert rate > 3


def test_on_the_command_line(run_cli, tmp_path, speech):
    samples, rate = speech
    soundfile.write(tmp_path / "short.wav", samples[: rate + 50], rate)
    done = run_cli("animate", "short.wav", "--bundle", TINY, "-o", "talk.mp4")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("talk.mp4: 29 frames at 30 fps (0.97 s), 42 vertices")
    assert "render: 100%" in done.stderr
    with av.open(tmp_path / "talk.mp4") as film:
        assert film.streams.video[0].frames == 29
        assert film.streams.audio[0].duration / SOUND_RATE == pytest.approx(29 / 30, abs=1e-3)


NEEDS_AV = "writing .mp4 needs av; in a clone of facecode: pip install '.[video]'"


def no_av(monkeypatch):
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setattr("facecode.animator.Animator.animate", lambda *_, **__: pytest.fail("began"))


def test_missing_extra_is_said_first(monkeypatch, capsys, tmp_path):
    no_av(monkeypatch)
    out = tmp_path / "talk.mp4"
    assert main(["animate", str(SPEECH), "--bundle", str(TINY), "-o", str(out)]) == 2
    err = capsys.readouterr().err
    assert (
        err == "facecode: writing .mp4 needs av; in a clone of facecode: pip install '.[video]'\n"
    )
    with pytest.raises(MissingExtraError, match=r"'\.\[video\]'"):
        clip().save(out)
    assert not list(tmp_path.iterdir())


def test_no_faces_is_said_first(monkeypatch, capsys, tmp_path):
    out = tmp_path / "talk.mp4"
    with pytest.raises(NoFacesError, match="export it again with --template MESH"):
        clip(faces=None).save(out)
    bundle = dataclasses.replace(Bundle.open(TINY), faces=None)
    monkeypatch.setattr("facecode.bundle.Bundle.open", lambda *_: bundle)
    monkeypatch.setattr("facecode.animator.Animator.animate", lambda *_, **__: pytest.fail("began"))
    assert main(["animate", str(SPEECH), "--bundle", str(TINY), "-o", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_interrupted_film_leaves_nothing(monkeypatch, tmp_path):
    drawn = Renderer.frame

    def interrupted(self, index):
        if index == 5:
            raise KeyboardInterrupt
        return drawn(self, index)

    monkeypatch.setattr(Renderer, "frame", interrupted)
    (tmp_path / "talk.mp4").write_bytes(b"old result")
    with pytest.raises(KeyboardInterrupt):
        clip().save(tmp_path / "talk.mp4")
    assert [f.name for f in tmp_path.iterdir()] == ["talk.mp4"]
    assert (tmp_path / "talk.mp4").read_bytes() == b"old result"


@pytest.mark.parametrize("room", [10, 4000, 20_000])
def test_full_disk_leaves_nothing(tmp_path, room):
    """Too little room for the header, for the index, for the pictures."""
    program = f"""
import resource, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_video import clip
from facecode.errors import OutputWriteError
given = clip(20)
resource.setrlimit(resource.RLIMIT_FSIZE, ({room}, {room}))
try:
    given.save("talk.mp4")
except OutputWriteError as error:
    print(error)
"""
    folders = [TINY.parents[1], Path(facecode.__file__).parents[1]]
    environment = {"PYTHONPATH": os.pathsep.join(map(str, folders))}
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("cannot write talk.mp4: ")
    assert not list(tmp_path.iterdir())


def test_a_disk_that_fails_is_an_output_error(monkeypatch, tmp_path):
    def full(_animation, _file, _progress):
        raise av.error.OSError(28, "No space left on device")

    monkeypatch.setitem(writers.FORMATS, ".mp4", Format(".mp4", full))
    with pytest.raises(OutputWriteError, match="No space"):
        clip().save(tmp_path / "talk.mp4")
    assert not list(tmp_path.iterdir())
