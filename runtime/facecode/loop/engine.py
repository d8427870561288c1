"""Speech to codes and motion: the encoder and the parts of a face as one value, without state.

Knows nothing of files or styles by name. Another codebook or timed graphs go in with `replace`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.arrays import AnyArray, Audio, Codes, Float32, Offsets
from facecode.bundle import Bundle
from facecode.clip import Clip
from facecode.errors import ModeError
from facecode.loop.exact import PrefixMotion
from facecode.loop.part import HEAD_CHUNK, Part
from facecode.loop.request import Request, Window, check_codes, sample_heads
from facecode.loop.step import Frame, GeneratedPart, HeldPart, MotionState, PartLoop, run_loop
from facecode.loop.window import WindowMotion
from facecode.options import Held, Samples
from facecode.session import Compute, Graph
from facecode.speech import Memory, SpeechEncoder


@dataclass(frozen=True)
class Engine:
    """What animates: graphs and codebooks."""

    speech_encoder: SpeechEncoder
    parts: tuple[Part, ...]
    n_vertices: int

    @classmethod
    def open(cls, bundle: Bundle, compute: Compute) -> Engine:
        """Load the graphs of a verified bundle.

        Raises:
            GraphError, ManifestError, ProviderError.
        """
        m = bundle.manifest
        encoder = Graph(bundle.path(m.speech_encoder.path), m.speech_encoder, compute)
        parts = tuple(Part.open(bundle, part, compute) for part in m.parts)
        return cls(SpeechEncoder(encoder, m), parts, m.n_vertices)

    @property
    def graphs(self) -> tuple[Graph, ...]:
        """All graphs in the order in which they run."""
        return (self.speech_encoder.graph, *(g for part in self.parts for g in part.graphs))

    @property
    def smallest_window(self) -> int:
        """The fewest frames that a step can decode."""
        return max(part.motion.n_newest for part in self.parts)

    def request(
        self,
        weights: Float32 | None = None,
        window: Window | None = None,
        samples: Samples | None = None,
        hold: Held | None = None,
        progress: bool = False,
    ) -> Request:
        """What to generate, checked against the parts.

        Args:
            weights: of the styles, (n_styles,), or (n_clips, n_styles); the first style by default.
            window: None for `exact`.
            samples: see `Animator.animate`.
            hold: codes (T, H), or a clip, by part name.
            progress: show a bar on stderr.

        Raises:
            SampleError, CodesError.
            ModeError: a part to hold that there is not.
        """
        if weights is None:
            weights = np.eye(1, self.parts[0].n_styles, dtype=np.float32)[0]
        held = {name: self._held(name, kept) for name, kept in (hold or {}).items()}
        heads = sample_heads(samples, self.parts, held)
        return Request(weights, heads, window, held, progress)

    def _held(self, name: str, kept: AnyArray | Clip) -> Codes:
        part = {p.name: p for p in self.parts}.get(name)
        if part is None:
            names = ", ".join(p.name for p in self.parts)
            raise ModeError(f"got {name!r} to hold; expected one of {names}")
        return check_codes(kept.codes_of(name) if isinstance(kept, Clip) else kept, part)

    def encode(self, waveform: Audio) -> Memory:
        """Waveform (n_samples,) at the bundle's rate to the memory of its T frames.

        Raises:
            AudioTooShortError
        """
        return self.speech_encoder.encode(waveform)

    def frames(self, memories: Sequence[Memory], request: Request) -> Iterator[Frame]:
        """The step loop over clips of falling length.

        Raises:
            CodesError: held codes of another length.
            ModeError: held codes, and several clips.
        """
        lengths = [memory.n_frames for memory in memories]
        loops = [self._loop(part, memories, request) for part in self.parts]
        return run_loop(self.parts, loops, lengths)

    def _loop(self, part: Part, memories: Sequence[Memory], request: Request) -> PartLoop:
        if part.name in request.hold:
            if len(memories) != 1:
                raise ModeError(f"got codes to hold and {len(memories)} recordings; expected one")
            codes = check_codes(request.hold[part.name], part, memories[0].n_frames)
            return HeldPart(codes[None])
        heads = request.heads[part.name]
        weights = np.broadcast_to(request.weights, (len(memories), part.n_styles))
        n_rows = len(memories) * len(heads)
        shape = (part.codes_per_frame, part.codebook.rows.shape[1])
        motion: MotionState
        if request.window is None:
            motion = PrefixMotion(part.motion, n_rows, shape)
        else:
            window = request.window
            motion = WindowMotion(part.motion, n_rows, shape, window.frames, window.delay)
        return GeneratedPart(part, memories, weights, heads, motion)

    def move(self, memories: Sequence[Memory], request: Request) -> list[tuple[Codes, Offsets]]:
        """Codes (K, T, H) and offsets (K, T, V, 3) of each clip, K faces a clip; see `frames`."""
        faces = Faces(self.parts, self.n_vertices, len(memories))
        frames = self.frames(memories, request)
        for frame in _with_bar(frames, memories[0].n_frames, request.progress):
            faces.add(frame)
        return [faces.take(clip) for clip in range(len(memories))]

    def animate(self, waveform: Audio, request: Request | None = None) -> tuple[Codes, Offsets]:
        """Codes (K, T, H) and offsets (K, T, V, 3) of one waveform.

        Args:
            waveform: (n_samples,) at the bundle's rate.
            request: by default one face in the first style, in `exact` mode.

        Raises:
            AudioTooShortError, CodesError.
        """
        request = self.request() if request is None else request
        return self.move([self.encode(waveform)], request)[0]

    def decode(self, codes: Codes) -> Offsets:
        """Codes (B, T, H) of whole faces, parts side by side, to offsets (B, T, V, 3).

        Raises:
            CodesError: another H, or codes outside the codebook.
        """
        edges = np.cumsum([part.codes_per_frame for part in self.parts])
        columns = np.split(np.asarray(codes), edges[:-1], axis=-1)
        by_part = [check_codes(c, part) for c, part in zip(columns, self.parts, strict=True)]
        return _compose(self.parts, self.n_vertices, by_part, [None] * len(by_part))[1]


class Faces:
    """Gathers what the loop gives, clip by clip, until it is taken; what is taken is not kept."""

    def __init__(self, parts: Sequence[Part], n_vertices: int, n_clips: int) -> None:
        self._parts, self._n_vertices = parts, n_vertices
        self._codes: list[list[list[Codes]]] = [[[] for _ in parts] for _ in range(n_clips)]
        self._hidden: list[dict[int, list[Float32]]] = [{} for _ in parts]

    def add(self, frame: Frame) -> None:
        """Take in one step of all clips."""
        for p, codes in enumerate(frame.codes):
            for clip, rows in enumerate(codes):
                self._codes[clip][p].append(rows)
        for waiting, final in zip(self._hidden, frame.final, strict=True):
            for rows, hidden in final:
                for row, frames in zip(range(rows.start, rows.stop), hidden, strict=True):
                    waiting.setdefault(row, []).append(frames)

    @property
    def n_final(self) -> int:
        """Frames of the first clip that can be taken before it ends."""
        return sum(len(frames) for frames in self._hidden[0].get(0, ()))

    def take(self, clip: int = 0, n: int | None = None) -> tuple[Codes, Offsets]:
        """The next `n` frames of a clip, or all of it: codes (K, n, H), offsets (K, n, V, 3)."""
        codes = [np.stack(c[:n], axis=1) for c in self._codes[clip]]
        hidden = [self._take_hidden(p, clip, len(c)) for p, c in enumerate(codes)]
        self._codes[clip] = [c[codes[0].shape[1] :] for c in self._codes[clip]]
        return _compose(self._parts, self._n_vertices, codes, hidden)

    def _take_hidden(self, part: int, clip: int, n_rows: int) -> Float32 | None:
        waiting, rows = self._hidden[part], range(clip * n_rows, (clip + 1) * n_rows)
        if rows.start not in waiting:
            return None
        return np.stack([np.concatenate(waiting.pop(row)) for row in rows])


def blocks(faces: Faces, frames: Iterable[Frame]) -> Iterator[tuple[Codes, Offsets]]:
    """Codes (K, n, H) and offsets (K, n, V, 3) of one clip, as frames become final.

    Nothing that was given is kept, so that a clip may have any length.
    """
    for frame in frames:
        faces.add(frame)
        is_last = not frame.codes
        if faces.n_final and (is_last or faces.n_final >= HEAD_CHUNK):
            yield faces.take(n=faces.n_final)


def _compose(
    parts: Sequence[Part],
    n_vertices: int,
    clip: Sequence[Codes],
    hidden: Sequence[Float32 | None],
) -> tuple[Codes, Offsets]:
    """Rows of each part's codes (rows, T, H) to codes and offsets of all faces.

    Frames that the loop has decoded already come as `hidden` (rows, T, E).
    """
    n_faces = max(len(codes) for codes in clip)
    n_frames = clip[0].shape[1]
    offsets = np.empty((n_faces, n_frames, n_vertices, 3), dtype=np.float32)
    every = []
    for part, codes, decoded in zip(parts, clip, hidden, strict=True):
        share = n_faces // len(codes)
        part.write_offsets(part.hidden_of(codes) if decoded is None else decoded, offsets[::share])
        for k in range(1, share):
            _copy(offsets[::share], offsets[k::share], part)
        every.append(np.repeat(codes, share, axis=0))
    return np.concatenate(every, axis=2), offsets


def _copy(source: Offsets, target: Offsets, part: Part) -> None:
    """The part's vertices of `source` into `target`, face by face."""
    if part.vertices is None:
        target[...] = source
    else:
        target[:, :, part.vertices] = source[:, :, part.vertices]


def _with_bar(frames: Iterator[Frame], n_frames: int, shown: bool) -> Iterator[Frame]:
    if not shown:
        yield from frames
        return
    from tqdm import tqdm

    with tqdm(total=n_frames, desc="animate", unit="frame") as bar:
        for frame in frames:
            bar.update(bool(frame.codes))
            yield frame
