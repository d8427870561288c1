"""Saved clips come back whole, and damaged files are one line."""

import dataclasses
import io
import zipfile

import numpy as np
import pytest
from conftest import SPEECH
from small_faces import rigged

import facecode
from facecode.cli.main import main
from facecode.clip_file import KINDS, read_clip
from facecode.errors import ClipFileError, ClipNotFoundError, FacecodeError
from facecode.writers import FORMATS


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """The packaged face, animated and saved."""
    path = tmp_path_factory.mktemp("clips") / "talk.npz"
    clip = facecode.load("demo", threads=1).animate(SPEECH, "calm", mode="window")
    clip.save(path)
    return clip, path


def test_everything_comes_back(saved):
    clip, path = saved
    found = read_clip(path)
    assert np.array_equal(found.vertices, clip.vertices)
    for field in dataclasses.fields(clip):
        want, got = getattr(clip, field.name), getattr(found, field.name)
        if field.name == "rig":
            assert got.names == want.names
            assert np.array_equal(got.deltas, want.deltas)
        elif field.name != "offsets":
            assert type(got) is type(want), field.name
            assert np.array_equal(got, want), field.name
            assert getattr(got, "dtype", None) == getattr(want, "dtype", None)
    assert np.abs(found.weights - clip.weights).max() < 1e-4


def test_the_same_clip_gives_the_same_bytes(saved, tmp_path):
    clip, path = saved
    clip.save(tmp_path / "again.npz")
    assert (tmp_path / "again.npz").read_bytes() == path.read_bytes()


def test_numpy_reads_it_as_before(saved):
    clip, path = saved
    with np.load(path) as arrays:
        assert set(arrays.files) <= set(KINDS)
        assert np.array_equal(arrays["vertices"], clip.vertices)
        assert np.array_equal(arrays["codes"], clip.codes)
        assert arrays["fps"] == 30


def test_one_of_several_faces(tmp_path):
    takes = facecode.load("diverse", threads=1).animate(SPEECH, samples=3, mode="window")
    takes.save(tmp_path / "takes.npz")
    for k in range(3):
        found = read_clip(tmp_path / "takes.npz", k)
        assert np.array_equal(found.vertices, takes[k].vertices)
        assert found.parts == takes[k].parts
        assert np.array_equal(found.codes_of("lips"), takes[k].codes_of("lips"))
    with pytest.raises(ClipFileError, match="3 faces; there is no number 3"):
        read_clip(tmp_path / "takes.npz", 3)


@pytest.mark.parametrize("suffix", [s for s in FORMATS if s not in (".mp4", ".usdc")])
def test_convert_to_every_format(saved, suffix, tmp_path, capsys):
    _, path = saved
    out = tmp_path / f"out{suffix}"
    assert main(["convert", str(path), "-o", str(out)]) == 0
    assert out.stat().st_size > 1000
    assert capsys.readouterr().out == f"{out}\n"


def small(tmp_path, **changes):
    """A saved small clip, with other arrays, or without those that are None."""
    whole = tmp_path / "whole.npz"
    facecode.Animation(
        **{field.name: getattr(rigged(3), field.name) for field in dataclasses.fields(rigged(3))}
    ).save(whole)
    with np.load(whole) as arrays:
        kept = {n: arrays[n] for n in arrays.files} | changes
    np.savez(tmp_path / "changed.npz", **{n: a for n, a in kept.items() if a is not None})
    return tmp_path / "changed.npz"


@pytest.mark.parametrize(
    "changes",
    [
        {"vertices": None},
        {"template": None},
        {"codes": np.zeros((4, 1), np.int64)},
        {"codes": np.zeros((3, 1))},
        {"vertices": np.zeros((3, 5, 3), np.float32)},
        {"vertices": np.full((3, 110, 3), np.nan, np.float32)},
        {"fps": np.float64(0)},
        {"fps": np.float64(np.nan)},
        {"fps": np.ones(3)},
        {"faces": np.full((4, 3), 10**6)},
        {"faces": np.full((4, 3), -1)},
        {"colours": np.zeros((3, 3), np.uint8)},
        {"rig_names": None},
        {"rig_names": np.array(["one"])},
        {"rig_deltas": np.zeros((4, 7, 3), np.float32)},
        {"lip_pair": np.array([0, 10**9])},
        {"audio": np.zeros(100, np.float32), "sample_rate": None},
        {"parts": np.array(["a", "b"])},
        {"codes_per_part": np.array([5])},
        {"unit": np.array(["a", 1], object)},
    ],
    ids=lambda c: "-".join(c),
)
def test_arrays_that_do_not_belong_together(tmp_path, changes):
    assert read_clip(small(tmp_path)).n_frames == 3
    with pytest.raises(ClipFileError):
        read_clip(small(tmp_path, **changes))


def first_line(path):
    """What is said of the file; nothing if it can be read."""
    try:
        read_clip(path)
    except FacecodeError as error:
        (line,) = str(error).strip().splitlines()
        return line
    return ""


def test_every_damage_is_one_line(tmp_path, capsys):
    data = bytearray(small(tmp_path).read_bytes())
    rng = np.random.default_rng(0)
    path, lines = tmp_path / "damaged.npz", []
    for _ in range(300):
        damaged = data.copy()
        for place in rng.integers(0, len(data), 8):
            damaged[place] = rng.integers(256)
        if rng.random() < 0.3:
            del damaged[rng.integers(len(damaged)) :]
        path.write_bytes(damaged)
        lines.append(first_line(path))
    assert "" not in lines
    assert len(set(lines)) > 2
    assert main(["convert", str(tmp_path / "none.npz"), "-o", str(tmp_path / "x.glb")]) == 2
    assert "does not exist" in capsys.readouterr().err
    with pytest.raises(ClipNotFoundError, match="is a folder"):
        read_clip(tmp_path)


def test_a_small_file_does_not_unpack_to_a_large_one(tmp_path):
    path = tmp_path / "bomb.npz"
    header = io.BytesIO()
    shape = (1 << 20, 100, 3)
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": shape}
    )
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("vertices.npy", "w", force_zip64=True) as member,
    ):
        member.write(header.getvalue())
        for _ in range(300):
            member.write(bytes(1 << 20))
    with pytest.raises(ClipFileError, match="unpacks to more than"):
        read_clip(path)


def test_a_header_is_not_believed(tmp_path):
    path = tmp_path / "lies.npz"
    with (
        zipfile.ZipFile(path, "w") as archive,
        archive.open("vertices.npy", "w") as member,
    ):
        np.lib.format.write_array_header_1_0(
            member, {"descr": "<f4", "fortran_order": False, "shape": (1 << 40, 1 << 40, 3)}
        )
    with pytest.raises(ClipFileError, match="it states float32"):
        read_clip(path)
