"""A page that opens anywhere: the face in WebGL, the sound in step, in one .html without requests.

Comes in: a clip with faces, or several. Goes out: the page of `page/` with the head (the bytes of
the .glb) and the speech (FLAC) inside. The page turns the head, plays, seeks and saves the .glb.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import BinaryIO

from facecode.clip import Clip
from facecode.errors import EmptyClipError
from facecode.writers.format import Format, gathered
from facecode.writers.glb import document_of
from facecode.writers.sound import speech_of

PAGE = Path(__file__).parent / "page"
SCRIPTS = ("head", "viewer", "player")


def write_html(clip: Clip, file: BinaryIO, progress: bool = False) -> None:
    """Write a clip to an open binary file; too quick for `progress`.

    Raises:
        NoFacesError: the clip has no triangles.
        EmptyClipError: the clip has no frame.
    """
    write_takes_html([clip], file, progress)


def write_takes_html(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:  # noqa: ARG001
    """Write faces side by side, with the sound of the first.

    Raises:
        NoFacesError: a clip has no triangles.
        EmptyClipError: the clips have no frame.
    """
    if not clips[0].n_frames:
        raise EmptyClipError(".html shows motion, and this clip has no frame")
    head = io.BytesIO()
    document_of(clips).write(head)
    page = (PAGE / "page.html").read_text(encoding="utf-8")
    parts = {name: (PAGE / f"{name}.js").read_bytes() for name in SCRIPTS}
    parts["style"] = (PAGE / "page.css").read_bytes()
    parts["glb"] = base64.b64encode(head.getbuffer())
    parts["sound"] = base64.b64encode(speech_of(clips[0], "FLAC") or b"")
    pieces = page.split("{{")
    file.write(pieces[0].encode())
    for piece in pieces[1:]:
        name, _, text = piece.partition("}}")
        file.write(parts[name])
        file.write(text.encode())


def write_blocks_html(face: Clip, n_frames: int, blocks: Iterable[Clip], file: BinaryIO) -> None:
    """Write a clip that comes in blocks; with a rig only its weights are held.

    Raises:
        See `write_html`.
    """
    del n_frames
    write_html(gathered(face, blocks), file)


HTML = Format(
    ".html",
    write_html,
    write_takes_html,
    write_blocks_html,
    needs_faces=True,
    needs_vertices=False,
)
