"""Region files, pickled templates, motion files and the folder layouts of VOCASET and BIWI."""

import pickle
import struct
from pathlib import Path

import numpy as np
import pytest

from facecode_exporter.data.array_pickle import read_array_pickle
from facecode_exporter.data.data_set import LAYOUTS, DataSet
from facecode_exporter.data.motion_files import read_motion
from facecode_exporter.errors import DataSetError, EvaluationError, RegionError
from facecode_exporter.evaluation.distances import Take, find_predictions, takes_of
from facecode_exporter.measures.regions import Regions, read_region_file, require_inside

FACE = np.arange(12, dtype=np.float64).reshape(4, 3)
SEEN = "FaceTalk_170728_03272_TA"
UNSEEN = "FaceTalk_170809_00138_TA"


def python_2_pickle(arrays):
    """What Python 2 wrote: byte strings, numpy.core, protocol 2."""

    def text(raw):
        return b"T" + struct.pack("<i", len(raw)) + raw

    result = b"\x80\x02}"
    for name, array in arrays.items():
        shape = b"".join(b"K" + bytes([n]) for n in array.shape)
        result += text(name.encode()) + b"cnumpy.core.multiarray\n_reconstruct\n"
        result += b"cnumpy\nndarray\nK\x00\x85" + text(b"b") + b"\x87R(K\x01(" + shape + b"t"
        result += b"cnumpy\ndtype\n" + text(array.dtype.str[1:].encode()) + b"K\x00K\x01\x87R"
        result += b"(K\x03" + text(b"<") + b"NNNJ\xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb"
        result += b"\x89" + text(array.tobytes()) + b"tbs"
    return result + b"."


def write_data(root: Path, clips, n_frames=6):
    """vertices_npy, wav and templates.pkl; frame t of each clip is the template plus t."""
    (root / "vertices_npy").mkdir(parents=True)
    (root / "wav").mkdir()
    subjects = {clip.rpartition("_")[0] for clip in clips}
    (root / "templates.pkl").write_bytes(python_2_pickle(dict.fromkeys(sorted(subjects), FACE)))
    for clip in clips:
        motion = FACE.reshape(1, 12) + np.arange(n_frames)[:, None]
        np.save(root / "vertices_npy" / f"{clip}.npy", motion)
    return root


def test_region_file(tmp_path):
    file = tmp_path / "lve.txt"
    file.write_text("12, 13,40 ,7\n")
    np.testing.assert_array_equal(read_region_file(file), [12, 13, 40, 7])
    file.write_text("12, 13,\n40,")
    np.testing.assert_array_equal(read_region_file(file), [12, 13, 40])


@pytest.mark.parametrize("text", ["", "1 2 3", "1, x", "1.5", "3, -1", "99999999999", "\xff"])
def test_broken_region_files(tmp_path, text):
    (tmp_path / "lve.txt").write_bytes(text.encode("latin1"))
    with pytest.raises(RegionError, match=r"lve\.txt"):
        read_region_file(tmp_path / "lve.txt")


def test_missing_and_foreign_regions(tmp_path):
    with pytest.raises(RegionError, match="cannot be read"):
        read_region_file(tmp_path / "none.txt")
    with pytest.raises(RegionError, match=r"upper_face names vertex 4; the mesh has 4"):
        require_inside(Regions(np.array([3]), np.array([0, 4])), 4)


@pytest.mark.parametrize("dtype", ["<f8", "<f4"])
def test_python_2_templates(tmp_path, dtype):
    arrays = {"F2": FACE.astype(dtype), "M3": -FACE.astype(dtype)}
    (tmp_path / "t.pkl").write_bytes(python_2_pickle(arrays))
    read = read_array_pickle(tmp_path / "t.pkl")
    plain = pickle.loads(python_2_pickle(arrays), encoding="latin1")
    assert list(read) == list(plain) == ["F2", "M3"]
    for name in read:
        np.testing.assert_array_equal(read[name], plain[name])
        assert read[name].dtype == dtype


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
@pytest.mark.parametrize("array", [FACE, FACE.T, FACE.astype(">f4"), FACE[::2]])
def test_python_3_templates(tmp_path, protocol, array):
    (tmp_path / "t.pkl").write_bytes(pickle.dumps({"a": array}, protocol))
    read = read_array_pickle(tmp_path / "t.pkl")["a"]
    np.testing.assert_array_equal(read, array)


class Runs:
    def __reduce__(self):
        return print, ("this must not run",)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"a": Runs()}, r"asks for (__builtin__|builtins)\.print"),
        ({"a": np.array([Runs()])}, "expected floats"),
        ({"a": np.array([1, 2])}, "expected floats"),
        ({"a": np.zeros(2, [("x", "f4")])}, "expected floats"),
        ({"a": "text"}, "no attribute"),
        ([FACE], "no attribute"),
    ],
)
def test_pickles_of_anything_else_are_refused(tmp_path, capsys, content, message):
    for protocol in (0, 2, 4):
        (tmp_path / "t.pkl").write_bytes(pickle.dumps(content, protocol))
        with pytest.raises(DataSetError, match=message):
            read_array_pickle(tmp_path / "t.pkl")
    assert "must not run" not in capsys.readouterr().out


def test_damaged_pickles_are_refused(tmp_path):
    whole = python_2_pickle({"a": FACE})
    damaged = [b"", b"no pickle", whole[:-30], whole.replace(b"K\x04K\x03", b"K\x09K\x03")]
    for content in damaged:
        (tmp_path / "t.pkl").write_bytes(content)
        with pytest.raises(DataSetError, match=r"expected a pickle of \{subject"):
            read_array_pickle(tmp_path / "t.pkl")
    with pytest.raises(DataSetError, match="No such file"):
        read_array_pickle(tmp_path / "none.pkl")


def test_motion_files(tmp_path):
    flat = np.arange(24, dtype=np.float32).reshape(2, 12)
    for shape in [(2, 12), (2, 4, 3), (1, 2, 12), (1, 2, 4, 3)]:
        np.save(tmp_path / "m.npy", flat.reshape(shape))
        np.testing.assert_array_equal(read_motion(tmp_path / "m.npy", 4), flat.reshape(2, 4, 3))
    np.save(tmp_path / "one.npy", flat[:1].reshape(1, 4, 3))
    assert read_motion(tmp_path / "one.npy", 4).shape == (1, 4, 3)
    np.savez(tmp_path / "m.npz", vertices=flat.reshape(2, 4, 3), fps=30.0)
    assert read_motion(tmp_path / "m.npz", 4, 30.0).shape == (2, 4, 3)
    with pytest.raises(EvaluationError, match="moves at 30 fps; expected 25"):
        read_motion(tmp_path / "m.npz", 4, 25.0)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((2, 13)), r"float64 \(2, 13\); expected floats \(T, 12\)"),
        (np.zeros(12), r"\(12,\)"),
        (np.zeros((2, 12), int), "int64"),
        (np.full((2, 12), np.nan), "NaN"),
        (np.array([{}]), "cannot be read"),
    ],
)
def test_motion_that_does_not_fit(tmp_path, array, message):
    np.save(tmp_path / "m.npy", array)
    with pytest.raises(EvaluationError, match=message):
        read_motion(tmp_path / "m.npy", 4)


@pytest.mark.parametrize(("name", "content"), [("m.npy", b"broken"), ("m.npz", b"PK\x03\x04")])
def test_damaged_motion_files(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(EvaluationError, match="cannot be read"):
        read_motion(tmp_path / name, 4)


def test_vocaset_is_halved_and_tested_on_its_unseen_subjects(tmp_path):
    clips = [f"{UNSEEN}_sentence{n:02}" for n in (1, 20, 21, 40)] + [f"{SEEN}_sentence21"]
    data = DataSet.open(write_data(tmp_path, clips), LAYOUTS["vocaset"])
    assert data.clips == (f"{UNSEEN}_sentence21", f"{UNSEEN}_sentence40")
    truth = data.truth(data.clips[0])
    np.testing.assert_array_equal(truth[:, 0, 0], [0, 2, 4])
    assert len(DataSet.open(tmp_path, LAYOUTS["vocaset"], "all").clips) == 5


def test_biwi_test_a_and_test_b(tmp_path):
    clips = [f"{s}_e{n:02}" for s in ("F1", "F2", "M6", "M5") for n in (32, 33, 36, 37, 40)]
    root = write_data(tmp_path, clips)

    def names(split):
        return DataSet.open(root, LAYOUTS["biwi"], split).clips

    assert names(None) == names("test-a") == ("F2_e37", "F2_e40", "M5_e37", "M5_e40")
    assert names("test-b") == ("F1_e37", "F1_e40", "M6_e37", "M6_e40")
    assert names("validation") == ("F2_e33", "F2_e36", "M5_e33", "M5_e36")
    assert len(DataSet.open(root, LAYOUTS["biwi"]).truth("F2_e37")) == 6


def test_all_subjects_of_the_splits():
    assert [len(LAYOUTS["biwi"].splits[s].subjects) for s in ("test-a", "test-b")] == [6, 8]
    vocaset = [*LAYOUTS["vocaset"].seen, *LAYOUTS["vocaset"].splits["test"].subjects]
    assert len({*vocaset, *LAYOUTS["vocaset"].splits["validation"].subjects}) == 12


def test_data_sets_that_cannot_be_opened(tmp_path):
    plain = LAYOUTS["plain"]
    with pytest.raises(DataSetError, match="has no folder vertices_npy"):
        DataSet.open(tmp_path, plain)
    root = write_data(tmp_path / "data", ["F2_e37"])
    with pytest.raises(DataSetError, match="got split 'test'; expected one of test-a, test-b"):
        DataSet.open(root, LAYOUTS["biwi"], "test")
    with pytest.raises(DataSetError, match="no clip of split 'test-b'"):
        DataSet.open(root, LAYOUTS["biwi"], "test-b")
    with pytest.raises(DataSetError, match=r"has no F2_e37\.wav"):
        DataSet.open(root, plain).speech("F2_e37")
    np.save(root / "vertices_npy" / "M9_e01.npy", np.zeros((1, 12)))
    with pytest.raises(DataSetError, match="no template of M9; it has F2"):
        DataSet.open(root, plain)


def test_predictions_are_found_by_clip_and_style(tmp_path):
    data = DataSet.open(write_data(tmp_path / "data", ["F2_e37", "F1_e37"]), LAYOUTS["plain"])
    folder = tmp_path / "predictions"
    folder.mkdir()
    names = ["F2_e37_condition_F2.npy", "F2_e37_condition_M3.npy", "other_e01.npy"]
    names += ["F1_e37_condition_F2.npz", "F1_e37_condition_M3.npy", "notes.txt"]
    for name in names[:3]:
        (folder / name).touch()
    with pytest.raises(EvaluationError, match="predicts 1 of 2 clips; it lacks F1_e37"):
        find_predictions(folder, data)
    for name in names:
        (folder / name).touch()
    takes = [Take("F1_e37", "F2"), Take("F1_e37", "M3"), Take("F2_e37", "F2")]
    assert list(find_predictions(folder, data)) == takes
    (folder / "F1_e37_condition_M3.npz").touch()
    with pytest.raises(EvaluationError, match="predict the same clip"):
        find_predictions(folder, data)
    with pytest.raises(EvaluationError, match="is no folder"):
        find_predictions(folder / "none", data)


def test_a_bundle_is_judged_in_the_own_style_of_a_seen_subject(tmp_path, tiny):
    data = DataSet.open(write_data(tmp_path, ["a_s01", "new_s01"]), LAYOUTS["plain"])
    assert takes_of(data, tiny, None) == [
        *(Take("a_s01", "a"), Take("new_s01", "a"), Take("new_s01", "b"), Take("new_s01", "c"))
    ]
    assert takes_of(data, tiny, ["c"]) == [Take("a_s01", "c"), Take("new_s01", "c")]


def test_files_that_macos_leaves_beside_are_passed_over(tmp_path):
    clip = f"{UNSEEN}_sentence21"
    root = write_data(tmp_path, [clip])
    for name in (f"vertices_npy/._{clip}.npy", f"wav/._{clip}.wav", "vertices_npy/.DS_Store"):
        (root / name).write_bytes(b"\0\5\x16\7")
    data = DataSet.open(root, LAYOUTS["vocaset"])
    assert data.clips == (clip,)
    assert set(find_predictions(root / "vertices_npy", data)) == {Take(clip, None)}
