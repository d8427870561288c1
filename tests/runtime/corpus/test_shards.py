"""Parquet in and out, read with pyarrow itself."""

import json

import numpy as np
import pytest
from conftest import N_SMALL, SPEECH, TINY, contents

import facecode

pq = pytest.importorskip("pyarrow.parquet")
pa = pytest.importorskip("pyarrow")


def test_a_row_a_recording(speeches, tiny, tmp_path):
    summary = facecode.batch(
        speeches, tmp_path / "out", bundle=str(TINY), workers=1, format="parquet", offsets=True
    )
    assert len(summary.failures) == 1
    (shard,) = (tmp_path / "out").glob("*.parquet")
    rows = {row["id"]: row for row in pq.read_table(shard).to_pylist()}
    assert len(rows) == N_SMALL + 1
    assert "not audio" in rows["bad"]["error"]
    assert rows["bad"]["codes"] is None
    clip, row = tiny.animate(speeches / "b/01.wav"), rows["b/01"]
    np.testing.assert_array_equal(row["codes"], clip.codes)
    np.testing.assert_allclose(
        np.reshape(row["offsets"], clip.offsets.shape), clip.offsets, atol=1e-5
    )
    assert (row["fps"], row["error"]) == (clip.fps, None)
    assert row["duration"] == pytest.approx(clip.duration_s)
    two = tmp_path / "two"
    facecode.batch(speeches, two, bundle=str(TINY), workers=2, format="parquet", offsets=True)
    assert contents(two) == contents(tmp_path / "out")


def test_weights_of_the_packaged_model(tmp_path):
    (tmp_path / "list.txt").write_text(str(SPEECH))
    facecode.batch(tmp_path / "list.txt", tmp_path / "out", workers=1, format="parquet")
    table = pq.read_table(tmp_path / "out" / "part-000000.parquet")
    clip = facecode.load().animate(SPEECH, vertices=False)
    np.testing.assert_array_equal(table["weights"][0].as_py(), clip.weights)
    assert json.loads(table.schema.metadata[b"weight_names"]) == list(clip.weight_names)


def test_a_column_of_bytes_and_paths(speeches, tiny, tmp_path):
    """As Hugging Face data sets have them, in two row groups."""
    audio = [{"bytes": (speeches / "a/00.wav").read_bytes(), "path": None}]
    audio += [
        {"bytes": None, "path": str(speeches / "b/01.wav")},
        {"bytes": b"RIFF", "path": "x"},
    ]
    table = pa.table({"audio": audio, "id": ["one", "two", "three"], "style": ["b", None, None]})
    pq.write_table(table, tmp_path / "set.parquet", row_group_size=2)
    summary = facecode.batch(
        tmp_path / "set.parquet", tmp_path / "out", bundle=str(TINY), workers=1
    )
    assert [f.id for f in summary.failures] == ["three"]
    for name, file, style in (("one", "a/00", "b"), ("two", "b/01", None)):
        with np.load(tmp_path / "out" / f"{name}.npz") as talk:
            codes = tiny.animate(speeches / f"{file}.wav", style).codes
            np.testing.assert_array_equal(talk["codes"], codes)
