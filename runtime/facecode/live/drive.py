"""Drive a stream from chunks of speech: in a loop, by a callback, or with asyncio."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterable, AsyncIterator, Callable, Iterable, Iterator

from facecode.arrays import AnyArray
from facecode.live.frame import LiveFrame
from facecode.live.stream import Stream

MOST_BEHIND_S = 0.5
"""Speech that may wait for its face; more of it is skipped, so that sound and face stay in step."""


def frames_of(
    stream: Stream, chunks: Iterable[AnyArray], sample_rate: int | None = None
) -> Iterator[LiveFrame]:
    """The frames of chunks as they come, and the rest when they end; errors as of `Stream.feed`."""
    for chunk in chunks:
        yield from stream.feed(chunk, sample_rate)
    yield from stream.finish()


def for_each_frame(
    stream: Stream,
    chunks: Iterable[AnyArray],
    show: Callable[[LiveFrame], None],
    sample_rate: int | None = None,
) -> None:
    """Call `show` with every frame of chunks as they come; see `frames_of`."""
    for frame in frames_of(stream, chunks, sample_rate):
        show(frame)


async def frames_of_async(
    stream: Stream, chunks: AsyncIterable[AnyArray], sample_rate: int | None = None
) -> AsyncIterator[LiveFrame]:
    """`frames_of` for asyncio: graphs run in a thread, and the event loop goes on."""
    async for chunk in chunks:
        for frame in await asyncio.to_thread(stream.feed, chunk, sample_rate):
            yield frame
    for frame in await asyncio.to_thread(stream.finish):
        yield frame


def keep_up(
    stream: Stream, chunks: Iterable[tuple[AnyArray, float]], sample_rate: int
) -> Iterator[LiveFrame]:
    """The frames of chunks that do not wait, such as a microphone's.

    Args:
        stream: the stream.
        chunks: each with the seconds of speech that wait behind it; while more than
            MOST_BEHIND_S do, chunks are heard and not animated; `stream.n_skipped` counts.
        sample_rate: of the chunks.
    """
    for chunk, waiting_s in chunks:
        take = stream.feed if waiting_s <= MOST_BEHIND_S else stream.skip
        yield from take(chunk, sample_rate)
    yield from stream.finish()
