"""A film to look at: H.264 and, where the clip has audio, AAC, in an .mp4 that starts at once.

Comes in: a clip with faces, or several. Goes out: a square picture of each per frame of
motion, in a row, and the speech, cut or padded to the same length. Knows nothing of triangles or
light.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from fractions import Fraction
from types import ModuleType
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from facecode.arrays import Float32
from facecode.clip import Clip
from facecode.errors import MissingExtraError, NoFacesError
from facecode.writers.format import Format

if TYPE_CHECKING:
    from facecode.render.paint import Picture
    from facecode.render.picture import Renderer

SIZE = 640  # pixels a side
PANEL = 360  # of one of several faces
WIDEST, HIGHEST = 4096, 2304
"""Pixels of a picture that the decoders of browsers and phones take (H.264 level 5.1)."""
SOUND_RATE = 48000
"""The encoder starts 1,024 samples late, which the file tells players to skip. The editors that
do not skip are 21 ms late at this rate, under a frame; at a model's 16 kHz it would be 64 ms."""
BLOCK = 1024
QUALITY = {"crf": "18", "preset": "veryfast"}
BITS_PER_S = 128_000
BT709 = 1
HEADER_BYTES, BYTES_PER_PACKET = 4096, 32
"""The index goes before the film, into room kept for it (faststart would need a file name, and
would copy the film). Bound: 28 bytes a packet in stsz, ctts, stco, stsc and stss."""


def check_mp4() -> None:
    """Refuse to begin without the library that encodes.

    Raises:
        MissingExtraError
    """
    _av()


def write_mp4(clip: Clip, file: BinaryIO, progress: bool = False) -> None:
    """Render and write a clip to an open binary file that can seek.

    Raises:
        NoFacesError: the clip has no triangles.
        MissingExtraError: av is not installed.
    """
    _write([clip], file, progress, SIZE)


def write_side_by_side(clips: Sequence[Clip], file: BinaryIO, progress: bool = False) -> None:
    """Several faces in a row, PANEL pixels each, and the sound of the first.

    More than fit into WIDEST stand in several rows, and are smaller where they would be too high.
    Each is framed by itself, as it would be alone.

    Args:
        clips: one or more, of one rate and number of frames.
        file: open, binary, can seek.
        progress: show a bar on stderr.

    Raises:
        ValueError: there are none, or they are not of one rate and length.
        NoFacesError: one has no triangles.
        MissingExtraError: av is not installed.
    """
    lengths = {(len(each.offsets), each.fps) for each in clips}
    if len(lengths) != 1:
        raise ValueError(
            f"expected clips of one rate and number of frames, got (frames, fps) {sorted(lengths)}"
        )
    n_columns, panel = arrangement(len(clips))
    _write(clips, file, progress, panel, n_columns)


def arrangement(n_faces: int) -> tuple[int, int]:
    """How many faces stand in a row of a film, and the pixels a side of each, an even number."""
    n_columns = n_faces if n_faces * PANEL <= WIDEST else math.ceil(math.sqrt(n_faces))
    n_rows = math.ceil(n_faces / n_columns)
    return n_columns, min(PANEL, WIDEST // n_columns, HIGHEST // n_rows) // 2 * 2


def _write(
    clips: Sequence[Clip], file: BinaryIO, progress: bool, size: int, n_columns: int = 1
) -> None:
    av = _av()
    first = clips[0]
    n_frames, rate = len(first.offsets), Fraction(first.fps).limit_denominator(1001)
    renderers = [_renderer(clip, size) for clip in clips]
    sound = _sound(first, n_frames / rate)
    n_packets = n_frames + (0 if sound is None else 2 + len(sound) // BLOCK)
    room = {"moov_size": str(HEADER_BYTES + BYTES_PER_PACKET * n_packets)}
    with av.open(file, "w", format="mp4", options=room) as film:
        n_rows = math.ceil(len(clips) / n_columns)
        pictures = _picture_stream(film, rate, size * n_columns, size * n_rows)
        if sound is not None:
            speech = film.add_stream("aac", rate=SOUND_RATE, layout="mono", bit_rate=BITS_PER_S)
        written = 0
        for index, pixels in enumerate(
            _counted(_together(renderers, n_columns), n_frames, progress)
        ):
            film.mux(pictures.encode(_picture(av, pixels, index, rate)))
            if sound is not None:  # side by side, so that a player need not seek
                until = len(sound) if index + 1 == n_frames else _samples_by(index + 1, rate)
                for block in _blocks(av, sound, written, until):
                    film.mux(speech.encode(block))
                    written = block.pts + block.samples
        film.mux(pictures.encode(None))
        if sound is not None:
            film.mux(speech.encode(None))


def _renderer(clip: Clip, size: int) -> Renderer:
    from facecode.render.picture import Renderer

    if clip.faces is None:
        raise NoFacesError.to_write(".mp4")
    return Renderer(clip.template, clip.offsets, clip.faces, clip.colours, size)


def _together(renderers: Sequence[Renderer], n_columns: int) -> Iterator[Picture]:
    """Frames (height, width, 3), planar in memory as the encoder takes them."""
    if len(renderers) == 1:
        yield from renderers[0].frames()
        return
    each = [renderer.frames(workers=1) for renderer in renderers]
    for pictures in zip(*each, strict=True):
        planes = [np.moveaxis(picture, 2, 0) for picture in pictures]
        planes += [_nobody(len(planes[0][0]))] * (-len(planes) % n_columns)
        rows = [planes[i : i + n_columns] for i in range(0, len(planes), n_columns)]
        yield np.moveaxis(np.concatenate([np.concatenate(r, 2) for r in rows], 1), 0, 2)


def _nobody(size: int) -> Picture:
    """What is behind a face, (3, size, size)."""
    from facecode.render import light

    return light.to_srgb(light.background(size))


def _av() -> ModuleType:
    try:
        import av
    except ImportError as error:
        raise MissingExtraError.of("writing .mp4", "av", "video") from error
    return av


def _picture_stream(film: Any, rate: Fraction, width: int, height: int) -> Any:  # noqa: ANN401
    stream = film.add_stream("h264", rate=rate, options=QUALITY)
    stream.width, stream.height = width, height
    stream.pix_fmt = "yuv420p"
    context = stream.codec_context
    context.time_base = 1 / rate
    context.colorspace = context.color_primaries = context.color_trc = BT709
    return stream


def _picture(av: Any, pixels: Any, index: int, rate: Fraction) -> Any:  # noqa: ANN401
    frame = av.VideoFrame.from_ndarray(pixels, format="gbrp")  # planar, as it is drawn
    frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709")
    frame.pts, frame.time_base = index, 1 / rate
    return frame


def _sound(clip: Clip, duration_s: Fraction) -> Float32 | None:
    """The speech at SOUND_RATE, cut or padded to `duration_s`; None where the clip has none."""
    if clip.audio is None or clip.sample_rate is None:
        return None
    import soxr

    speech = soxr.resample(clip.audio, clip.sample_rate, SOUND_RATE)
    sound = np.zeros(round(duration_s * SOUND_RATE), np.float32)
    n_given = min(len(speech), len(sound))
    sound[:n_given] = np.clip(speech[:n_given], -1, 1)
    return sound


def _samples_by(index: int, rate: Fraction) -> int:
    return int(index / rate * SOUND_RATE)


def _blocks(av: Any, sound: Float32, start: int, until: int) -> Iterator[Any]:  # noqa: ANN401
    """Whole blocks of sound between `start` and `until`, and at the very end the rest."""
    while start < until and (start + BLOCK <= until or until == len(sound)):
        part = sound[start : min(start + BLOCK, until)]
        block = av.AudioFrame.from_ndarray(part[None], format="fltp", layout="mono")
        block.sample_rate, block.pts = SOUND_RATE, start
        block.time_base = Fraction(1, SOUND_RATE)
        yield block
        start += len(part)


def _counted(frames: Iterable[Picture], n_frames: int, progress: bool) -> Iterable[Picture]:
    if not progress:
        return frames
    from tqdm import tqdm

    return tqdm(frames, desc="render", unit="frame", total=n_frames)


MP4 = Format(".mp4", write_mp4, write_side_by_side, needs_faces=True, check=check_mp4)
