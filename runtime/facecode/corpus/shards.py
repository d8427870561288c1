"""Parquet as a destination: a row a recording, with codes and weights, or why there is none."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from facecode import writers
from facecode.arrays import AnyArray
from facecode.clip import Clip
from facecode.corpus.tables import parquet
from facecode.errors import FacecodeError

Row = tuple[str, "Clip | FacecodeError"]
"""The name of a recording, and its clip or why there is none."""


def write_shard(
    path: Path, rows: Sequence[Row], weight_names: Sequence[str] | None, offsets: bool
) -> None:
    """Write rows to one Parquet file; whole or not at all.

    Columns: id; fps; codes, weights and offsets as a list of frames, each a list of H codes, of K
    weights, of 3 V numbers; duration in seconds; error. Null is what is not known. The names of
    the weights are JSON in the schema's metadata, under `weight_names`.

    Raises:
        MissingExtraError, OutputWriteError
    """
    pq = parquet()
    import pyarrow as pa

    frames = {"codes": pa.int32(), "weights": pa.float32()}
    if offsets:
        frames["offsets"] = pa.float32()
    fields = [("id", pa.string()), ("fps", pa.float64())]
    fields += [(name, pa.list_(pa.list_(kind))) for name, kind in frames.items()]
    fields += [("duration", pa.float64()), ("error", pa.string())]
    metadata = {} if weight_names is None else {"weight_names": json.dumps(list(weight_names))}
    schema = pa.schema(fields, metadata=metadata)
    plain = [_plain(*row, weight_names is not None, offsets) for row in rows]
    columns = [pa.array([row.get(name) for row in plain], kind) for name, kind in fields]
    with writers.writing(path) as file:
        pq.write_table(pa.Table.from_arrays(columns, schema=schema), file, compression="zstd")


def _plain(name: str, clip: Clip | FacecodeError, weights: bool, offsets: bool) -> dict[str, Any]:
    if isinstance(clip, FacecodeError):
        return {"id": name, "error": str(clip)}
    row = {"id": name, "fps": clip.fps, "codes": _frames(clip.codes.astype("int32"))}
    if weights:
        row["weights"] = _frames(clip.weights)
    if offsets:
        row["offsets"] = _frames(clip.offsets)
    return row | {"duration": clip.duration_s}


def _frames(array: AnyArray) -> list[AnyArray]:
    return list(array.reshape(len(array), -1))
