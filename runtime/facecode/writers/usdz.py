"""A head with its speech in one file: .usdz, the layer of `.usda` and a .wav in a zip archive.

USD asks that members are stored as they are, each beginning at a multiple of ALIGNMENT bytes, the
layer first: then a reader maps them into memory.
"""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Iterable, Sequence
from typing import BinaryIO

from facecode.clip import Clip
from facecode.errors import OutputWriteError
from facecode.writers.format import Format, gathered
from facecode.writers.shapes import shapes_of
from facecode.writers.sound import speech_of
from facecode.writers.usd.scene import scene

LAYER, SPEECH = "face.usda", "speech.wav"
ALIGNMENT = 64
HEADER_BYTES = 30  # of a member, before its name
PADDING = struct.Struct("<HH")
PADDING_ID = 0x1986


def write_usdz(clip: Clip, file: BinaryIO, progress: bool = False) -> None:
    """Write a clip to an open binary file that can seek; too quick for `progress`.

    Raises:
        NoFacesError: the clip has no triangles.
        OutputWriteError: over 2 GiB.
    """
    write_takes_usdz([clip], file, progress)


def write_takes_usdz(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:
    """Write faces side by side, and the speech of the first, if it is there.

    Raises:
        NoFacesError: a clip has no triangles.
        OutputWriteError: over 2 GiB.
    """
    del progress
    speech = speech_of(clips[0], "WAV")
    sound = None if speech is None else SPEECH
    layer = scene(clips, ".usdz", shapes_of(clips), sound).encode()
    try:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_STORED, allowZip64=False) as archive:
            _add(archive, file, LAYER, layer)
            if speech is not None:
                _add(archive, file, SPEECH, speech)
    except zipfile.LargeZipFile as error:
        raise OutputWriteError(
            ".usdz holds 2 GiB at most, and this is more; write .usda, or a shorter recording"
        ) from error


def write_blocks_usdz(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks; with a rig only its weights are held.

    Raises:
        NoFacesError: the clip has no triangles.
        OutputWriteError: over 2 GiB.
    """
    del n_frames
    write_usdz(gathered(face, blocks), file)


def _add(archive: zipfile.ZipFile, file: BinaryIO, name: str, content: bytes) -> None:
    member = zipfile.ZipInfo(name)  # of 1980: same input, same bytes
    begins = file.tell() + HEADER_BYTES + len(name) + PADDING.size
    padding = -begins % ALIGNMENT
    member.extra = PADDING.pack(PADDING_ID, padding) + bytes(padding)
    archive.writestr(member, content)


USDZ = Format(
    ".usdz", write_usdz, write_takes_usdz, write_blocks_usdz, needs_faces=True, needs_vertices=False
)
