"""numpy's .npz: all that a clip knows, so that it can be read again (`facecode.read_clip`).

`vertices` (T, V, 3) float32, `codes` (T, H) int64, `fps` (), and what is known of the face and the
speech under the names of `Clip`'s fields. Several faces have a first axis more. Where a face has
several parts, `parts` and `codes_per_part` say which columns of the codes belong to which.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Sequence
from typing import BinaryIO

import numpy as np

from facecode.arrays import AnyArray
from facecode.clip import Clip
from facecode.writers.format import Format

COMPRESSED = ("rig_deltas", "faces")
"""Arrays that shrink to a tenth; the others hardly do, and would take long."""
STAMP = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file can say: the same bytes every time


def write_blocks_npz(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks to an open binary file that can seek."""
    codes = [face.codes[:0]]
    with zipfile.ZipFile(file, "w") as archive:
        with _member(archive, "vertices") as member:
            shape = (n_frames, *face.template.shape)
            header = {"descr": "<f4", "fortran_order": False, "shape": shape}
            np.lib.format.write_array_header_1_0(member, header)
            for block in blocks:
                codes.append(block.codes)
                member.write(np.asarray(block.offsets + block.template, "<f4").data)
        _write_all(archive, {"codes": np.concatenate(codes), **_known(face)})


def write_npz(clip: Clip, file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write a clip to an open binary file that can seek."""
    write_blocks_npz(clip, len(clip.codes), [clip], file)


def write_takes_npz(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write several faces of one recording: `vertices` (K, T, V, 3), `codes` (K, T, H)."""
    vertices = np.stack([clip.offsets + clip.template for clip in clips])
    codes = np.stack([clip.codes for clip in clips])
    with zipfile.ZipFile(file, "w") as archive:
        _write_all(archive, {"vertices": vertices, "codes": codes, **_known(clips[0])})


def _known(face: Clip) -> dict[str, AnyArray]:
    """All but vertices and codes, under the names of the fields; what is not known is left out."""
    known = {
        "fps": np.float64(face.fps),
        "parts": np.array(list(face.parts)) if len(face.parts) > 1 else None,
        "codes_per_part": np.array(list(face.parts.values())) if len(face.parts) > 1 else None,
        "template": face.template,
        "faces": face.faces,
        "colours": face.colours,
        "unit": np.array(face.unit),
        "metres_per_unit": face.metres_per_unit,
        "up_axis": face.up_axis,
        "styles": np.array(list(face.styles)) if face.styles else None,
        "style_weights": np.array(list(face.styles.values())) if face.styles else None,
        "mode": np.array(face.mode),
        "lip_pair": face.lip_pair,
        "audio": face.audio,
        "sample_rate": face.sample_rate,
        "rig_names": None if face.rig is None else np.array(face.rig.names),
        "rig_deltas": None if face.rig is None else face.rig.deltas,
    }
    return {name: np.asarray(value) for name, value in known.items() if value is not None}


def _write_all(archive: zipfile.ZipFile, arrays: dict[str, AnyArray]) -> None:
    for name, array in arrays.items():
        with _member(archive, name) as member:
            np.lib.format.write_array(member, array, allow_pickle=False)


def _member(archive: zipfile.ZipFile, name: str) -> BinaryIO:
    """An array's file in the archive, with the same bytes every time."""
    info = zipfile.ZipInfo(f"{name}.npy", STAMP)
    info.compress_type = zipfile.ZIP_DEFLATED if name in COMPRESSED else zipfile.ZIP_STORED
    return archive.open(info, "w", force_zip64=True)  # type: ignore[return-value]


NPZ = Format(".npz", write_npz, write_takes_npz, write_blocks_npz)
