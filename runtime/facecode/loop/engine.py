"""Speech to codes and motion: the encoder and the parts of a face as one value, without state.

Knows nothing of files or styles by name. Another codebook or timed graphs go in with `replace`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from facecode.arrays import AnyArray, Audio, Codes, Float32, Offsets
from facecode.bundle import Bundle
from facecode.loop.codes import check_codes
from facecode.loop.exact import PrefixMotion
from facecode.loop.held import HeldPart
from facecode.loop.offsets import OffsetsPart
from facecode.loop.part import HEAD_CHUNK, Part, offsets_of, products_of
from facecode.loop.protocols import MotionState, PartLoop
from facecode.loop.request import Request, Window, request_of
from facecode.loop.stated import stated_graphs
from facecode.loop.step import DecoderStep, Frame, GeneratedPart, run_loop, with_bar
from facecode.loop.window import LONGEST_PAST, WindowMotion
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
        """Load the graphs of a verified bundle; GraphError, ManifestError, ProviderError."""
        m = bundle.manifest
        encoder = Graph(bundle.path(m.speech_encoder.path), m.speech_encoder, compute)
        with stated_graphs(bundle.root):
            parts = tuple(Part.open(bundle, part, compute) for part in m.parts)
        return cls(SpeechEncoder(encoder, m), parts, m.n_vertices)

    @property
    def graphs(self) -> tuple[Graph, ...]:
        """All graphs in the order in which they run."""
        return (self.speech_encoder.graph, *(g for part in self.parts for g in part.graphs))

    @property
    def smallest_window(self) -> int:
        """The fewest frames that a step can decode."""
        return max(1 if part.motion is None else part.motion.n_newest for part in self.parts)

    def request(
        self,
        weights: Float32 | None = None,
        window: Window | None = None,
        samples: Samples | None = None,
        hold: Held | None = None,
        vertices: bool = True,
        progress: bool = False,
    ) -> Request:
        """What to generate, checked against the parts; see `request_of` for each and errors."""
        return request_of(self.parts, weights, window, samples, hold, vertices, progress)

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
        loops = self.loops(memories, request)
        return run_loop(self.parts, loops, [memory.n_frames for memory in memories])

    def loops(self, memories: Sequence[Memory], request: Request) -> list[PartLoop]:
        """The loops of all parts, at frame 0; see `frames` for errors."""
        return [self._loop(part, memories, request) for part in self.parts]

    def _loop(self, part: Part, memories: Sequence[Memory], request: Request) -> PartLoop:
        if part.name in request.hold:
            return HeldPart.of(part, request.hold[part.name], memories)
        heads = request.heads[part.name]
        weights = np.broadcast_to(request.weights, (len(memories), part.n_styles))
        n_rows, window = len(memories) * len(heads), request.window
        if part.codebook is None:
            past = None if window is None else LONGEST_PAST
            return OffsetsPart(DecoderStep(part, memories, weights, heads, past))
        codebook, decoder = part.prior
        shape = (part.codes_per_frame, codebook.rows.shape[1])
        motion: MotionState
        if window is None:
            motion = PrefixMotion(decoder, n_rows, shape)
        else:
            motion = WindowMotion(decoder, n_rows, shape, window.frames, window.delay)
        step = DecoderStep(part, memories, weights, heads, motion.longest_past)
        return GeneratedPart(codebook, step, motion)

    def move(self, memories: Sequence[Memory], request: Request) -> list[tuple[Codes, AnyArray]]:
        """Codes (K, T, H) and offsets (K, T, V, 3) of each clip, K faces a clip; see `frames`.

        Without vertices products (K, T, U) in place of offsets.
        """
        faces = self._faces(request, len(memories))
        frames = self.frames(memories, request)
        for frame in with_bar(frames, memories[0].n_frames, request.progress):
            faces.add(frame)
        return [faces.take(clip) for clip in range(len(memories))]

    def blocks(self, memory: Memory, request: Request) -> Iterator[tuple[Codes, AnyArray]]:
        """What `move` gives of one clip, to the bit, HEAD_CHUNK frames at a time; see `frames`.

        In `window` mode as frames become final; in `exact` mode they do so with the last frame.
        """
        frames = with_bar(self.frames([memory], request), memory.n_frames, request.progress)
        return blocks(self._faces(request, 1), frames)

    def _faces(self, request: Request, n_clips: int) -> Faces:
        return Faces(self.parts, self.n_vertices if request.vertices else None, n_clips)

    def animate(self, waveform: Audio, request: Request | None = None) -> tuple[Codes, AnyArray]:
        """Codes (K, T, H) and offsets (K, T, V, 3), or products, of one waveform.

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

    def __init__(self, parts: Sequence[Part], n_vertices: int | None, n_clips: int = 1) -> None:
        """Begin without a frame; without `n_vertices` products are taken in place of offsets."""
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
    def n_waiting(self) -> int:
        """Frames of the first clip that have not been taken, final or not."""
        return len(self._codes[0][0])

    @property
    def n_final(self) -> int:
        """Frames of the first clip that can be taken before it ends."""
        every = (sum(map(len, waiting.get(0, ()))) for waiting in self._hidden)
        return min(self.n_waiting, *every)

    def finish(self) -> None:
        """Make what is left of the first clip final: `exact` decodes it now."""
        for waiting, part, codes in zip(self._hidden, self._parts, self._codes[0], strict=True):
            if codes and 0 not in waiting:
                rows = part.hidden_of(np.stack(codes, axis=1))
                waiting.update((row, [hidden]) for row, hidden in enumerate(rows))

    def take(self, clip: int = 0, n: int | None = None) -> tuple[Codes, AnyArray]:
        """The next `n` frames of a clip, or all of it: codes (K, n, H), offsets (K, n, V, 3).

        Without vertices the second is the products (K, n, U) with the deltas of the rig.
        """
        codes = [np.stack(c[:n], axis=1) for c in self._codes[clip]]
        hidden = [self._take_hidden(p, clip, each) for p, each in enumerate(codes)]
        self._codes[clip] = [c[codes[0].shape[1] :] for c in self._codes[clip]]
        return _compose(self._parts, self._n_vertices, codes, hidden)

    def _take_hidden(self, part: int, clip: int, codes: Codes) -> Float32 | None:
        waiting, (n_rows, n, _) = self._hidden[part], codes.shape
        rows = range(clip * n_rows, (clip + 1) * n_rows)
        if rows.start not in waiting:
            return None
        found = np.stack([np.concatenate(waiting.pop(row)) for row in rows])
        if n < found.shape[1]:
            waiting.update((row, [rest]) for row, rest in zip(rows, found[:, n:], strict=True))
        return found[:, :n]


def blocks(faces: Faces, frames: Iterable[Frame]) -> Iterator[tuple[Codes, AnyArray]]:
    """Codes (K, n, H) and offsets (K, n, V, 3), or products, of one clip as frames become final.

    Blocks have HEAD_CHUNK frames but for the last, so that every frame comes out as in the whole
    clip. Nothing that was given is kept, so that a clip may have any length.
    """
    for frame in frames:
        faces.add(frame)
        if frame.codes and faces.n_final >= HEAD_CHUNK:
            yield faces.take(n=HEAD_CHUNK)
    faces.finish()
    while faces.n_waiting:
        yield faces.take(n=HEAD_CHUNK)


def _compose(
    parts: Sequence[Part],
    n_vertices: int | None,
    clip: Sequence[Codes],
    hidden: Sequence[Float32 | None],
) -> tuple[Codes, AnyArray]:
    """Rows of each part's codes (rows, T, H) to codes and offsets, or products, of all faces.

    Frames that the loop has decoded already come as `hidden` (rows, T, E).
    """
    pairs = zip(parts, clip, hidden, strict=True)
    decoded = [part.hidden_of(c) if h is None else h for part, c, h in pairs]
    n_faces = max(len(codes) for codes in clip)
    codes = np.concatenate([np.repeat(c, n_faces // len(c), axis=0) for c in clip], axis=2)
    if n_vertices is None:
        return codes, products_of(parts, decoded, n_faces)
    return codes, offsets_of(parts, decoded, n_faces, n_vertices)
