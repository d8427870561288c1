"""One client, one face: speech in, frames out, until one of the two or a limit ends it."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Coroutine, Mapping
from dataclasses import dataclass
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from facecode.errors import FacecodeError
from facecode.live.frame import LiveFrame
from facecode.live.stream import Stream
from facecode.serve.backlog import Backlog, Chunk, Item
from facecode.serve.house import House
from facecode.serve.limits import SEND_S
from facecode.serve.protocol import (
    Command,
    Opening,
    message,
    pack_frames,
    parse_command,
    parse_samples,
)

CODES = {
    "finished": 1000,
    "rubbish": 1007,
    "token": 1008,
    "idle": 1008,
    "too_long": 1008,
    "slow": 1008,
    "defect": 1011,
    "busy": 1013,
}
"""Close codes of WebSocket (RFC 6455) by why the server ends a connection."""
TOO_BIG = 1009


@dataclass(frozen=True)
class End:
    """How a connection ends."""

    reason: str
    """One of CODES, or why it has ended already."""
    text: str = ""
    """For the client."""


LEFT = End("left")
FINISHED = End("finished")


class Session:
    """The stream of a client that has said what it wants."""

    def __init__(self, socket: WebSocket, house: House, opening: Opening, stream: Stream) -> None:
        """Serve `socket`, whose opening was read."""
        self._socket, self._house, self._stream = socket, house, stream
        self._rate, self._live = opening.sample_rate, opening.live
        self._backlog = Backlog(opening.sample_rate, opening.live)
        self._next_frame = self._n_skipped = 0

    async def run(self) -> End:
        """Serve until the end."""
        tasks = [asyncio.create_task(each) for each in (self._hear(), self._animate())]
        try:
            done, _ = await asyncio.wait(
                tasks, timeout=self._house.limits.seconds, return_when=asyncio.FIRST_COMPLETED
            )
        finally:
            for task in tasks:
                task.cancel()
        if not done:
            return End("too_long", f"a session lasts {self._house.limits.seconds:g} s at most")
        await asyncio.wait(tasks)
        return next(task for task in tasks if task in done).result()

    async def _hear(self) -> End:
        """Take in what the client sends."""
        idle_s = self._house.limits.idle_s
        while True:
            try:
                got = await asyncio.wait_for(self._socket.receive(), idle_s)
            except asyncio.TimeoutError:
                return End("idle", f"no message for {idle_s:g} s")
            if got["type"] == "websocket.disconnect":
                return gone(got)
            try:
                if got.get("text") is not None:
                    self._backlog.order(parse_command(got["text"]))
                else:
                    parse_samples(got["bytes"])
                    self._backlog.put(got["bytes"], time.monotonic())
            except FacecodeError as error:
                return End("rubbish", str(error))
            await self._backlog.room()

    async def _animate(self) -> End:
        """Answer what was taken in, in its order."""
        while True:
            item = await self._backlog.take()
            try:
                frames = await self._house.work(lambda item=item: self._apply(item))  # type: ignore[misc]
            except FacecodeError as error:
                return End("rubbish", str(error))
            ended = await sent(self._answer(item, frames))
            if ended is not None:
                return ended
            if isinstance(item, Command) and item.type == "finish":
                return FINISHED

    def _apply(self, item: Item) -> list[LiveFrame]:
        """Frames of an item; runs in a worker thread, one item of a session at a time."""
        stream = self._stream
        if isinstance(item, Chunk):
            hear = stream.skip if item.skipped else stream.feed
            return hear(parse_samples(item.data), self._rate)
        if item.type == "style":
            stream.restyle(item.style, item.blend_s)
            return []
        if item.type == "reset":
            stream.reset()
            return []
        return stream.flush() if item.type == "flush" else stream.finish()

    async def _answer(self, item: Item, frames: list[LiveFrame]) -> None:
        metrics, socket = self._house.metrics, self._socket
        if isinstance(item, Chunk):
            metrics.audio_s += len(item.data) / (2 * self._rate)
        elif item.type == "reset":
            self._next_frame = self._n_skipped = 0
        if frames:
            await socket.send_bytes(pack_frames(frames))
            self._next_frame = frames[-1].index + 1
            metrics.frames += len(frames)
            if self._live and isinstance(item, Chunk) and not item.skipped:
                metrics.answered(time.monotonic() - item.arrived)
        if self._stream.n_skipped > self._n_skipped:
            metrics.skipped_frames += self._stream.n_skipped - self._n_skipped
            self._n_skipped = self._stream.n_skipped
            await socket.send_text(message("skipped", frames=self._n_skipped))
        if isinstance(item, Command):
            fields = {"next_frame": self._next_frame, "skipped": self._n_skipped}
            await socket.send_text(message(f"{item.type}_done", **fields))


def gone(message: Mapping[str, Any]) -> End:
    """How a connection ended that ASGI says is closed."""
    return End("too_big") if message.get("code") == TOO_BIG else LEFT


async def sent(sending: Coroutine[Any, Any, None]) -> End | None:
    """Send, and say how the connection ends if that fails."""
    try:
        await asyncio.wait_for(sending, SEND_S)
    except asyncio.TimeoutError:
        return End("slow", f"a message was not taken within {SEND_S:g} s")
    except (WebSocketDisconnect, RuntimeError):  # RuntimeError: after the server has closed it
        return LEFT
    return None
