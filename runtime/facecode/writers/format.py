"""What an output format is: one object, made in the file that writes it."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, TypeAlias

import numpy as np

from facecode.clip import Clip

Write: TypeAlias = "Callable[[Clip, BinaryIO, bool], None]"
"""(clip, an open binary file that can seek, whether to show progress on stderr)"""
WriteTakes: TypeAlias = "Callable[[Sequence[Clip], BinaryIO, bool], None]"
"""The same for several clips of one recording, of one rate and length."""
WriteBlocks: TypeAlias = "Callable[[Clip, int, Iterable[Clip], BinaryIO], None]"
"""(what is known of the face, how many frames there will be, clips of the frames one after the
other, an open binary file that need not seek): the bytes do not depend on how frames are cut"""


@dataclass(frozen=True)
class Format:
    """A format by its suffix."""

    suffix: str
    """Lower case, with the dot."""
    write: Write
    write_takes: WriteTakes | None = None
    """None: a file holds one face."""
    write_blocks: WriteBlocks | None = None
    """None: the whole clip must be there before the first byte is written."""
    needs_faces: bool = False
    """The format shows a surface, or cannot say points without triangles."""
    needs_rig: bool = False
    """The format holds weights of face units."""
    needs_vertices: bool = True
    """False: weights of face units will do, where there are units."""
    check: Callable[[], None] | None = None
    """Raises MissingExtraError if a package is missing; None: the core packages will do."""


def of_blocks(write_blocks: WriteBlocks) -> Write:
    """The writer of whole clips for a format that can be written block by block."""

    def write(clip: Clip, file: BinaryIO, progress: bool) -> None:
        del progress
        write_blocks(clip, clip.n_frames, [clip], file)

    return write


def gathered(face: Clip, blocks: Iterable[Clip]) -> Clip:
    """The clip whose frames are those of the blocks; its weights alone where it has a rig."""
    parts = list(_weights_alone(face, blocks))
    known = [part.known_weights for part in parts if part.known_weights is not None]
    return dataclasses.replace(
        face,
        offsets=np.concatenate([part.offsets for part in parts]) if parts else face.offsets,
        codes=np.concatenate([part.codes for part in parts]) if parts else face.codes,
        known_weights=np.concatenate(known) if known else None,
    )


def _weights_alone(face: Clip, blocks: Iterable[Clip]) -> Iterator[Clip]:
    for block in blocks:
        if face.rig is None:
            yield block
        else:
            none = block.offsets[:, :0].copy()
            yield dataclasses.replace(block, offsets=none, known_weights=block.weights)


def by_path(suffix: str, write: Callable[[Clip, Path, bool], None]) -> Write:
    """A writer for libraries that want a file name: they get one in a temporary folder."""

    def write_through(clip: Clip, file: BinaryIO, progress: bool) -> None:
        with tempfile.TemporaryDirectory(prefix="facecode-") as folder:
            path = Path(folder) / f"clip{suffix}"
            write(clip, path, progress)
            with path.open("rb") as written:
                while block := written.read(1 << 20):
                    file.write(block)

    return write_through
