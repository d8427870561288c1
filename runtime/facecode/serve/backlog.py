"""Speech and commands of one client that wait to be heard, in their order, and never many."""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass
from typing import TypeAlias

from facecode.live.drive import MOST_BEHIND_S
from facecode.serve.limits import HELD_S, SLICE_S
from facecode.serve.protocol import BYTES_PER_SAMPLE, Command

MOST_ITEMS = 64


@dataclass(frozen=True)
class Chunk:
    """Speech to hear at once."""

    data: bytes
    skipped: bool
    """Whether to skip it, because too much of it waited."""
    arrived: float
    """When its last sample came, in seconds of the clock that `put` was told."""


Item: TypeAlias = "Chunk | Command"


class Backlog:
    """A queue of speech in seconds; belongs to an event loop."""

    def __init__(self, sample_rate: int, live: bool) -> None:
        """For speech of 16 bits; that of `live` is skipped where over MOST_BEHIND_S of it wait."""
        self._bytes_per_s, self._live = sample_rate * BYTES_PER_SAMPLE, live
        self._items: deque[bytearray | Command] = deque()
        self._n_bytes, self._last = 0, 0.0
        self._changed = asyncio.Event()

    @property
    def waiting_s(self) -> float:
        """Speech that waits."""
        return self._n_bytes / self._bytes_per_s

    def put(self, data: bytes, now: float) -> None:
        """Add speech that came `now`."""
        if not self._items or isinstance(self._items[-1], Command):
            self._items.append(bytearray())
        run = self._items[-1]
        assert isinstance(run, bytearray), "added above"
        run += data
        self._n_bytes += len(data)
        self._last = now
        self._changed.set()

    def order(self, command: Command) -> None:
        """Add a command; `reset` forgets all that waits."""
        if command.type == "reset":
            self._items.clear()
            self._n_bytes = 0
        self._items.append(command)
        self._changed.set()

    async def room(self) -> None:
        """Wait until more may be added."""
        while self.waiting_s >= HELD_S or len(self._items) >= MOST_ITEMS:
            await self._change()

    async def take(self) -> Item:
        """Wait for the next command, or up to SLICE_S of speech, or all of it to be skipped."""
        while not self._items:
            await self._change()
        first = self._items[0]
        if isinstance(first, Command):
            self._items.popleft()
            self._changed.set()
            return first
        skipped = self._live and self.waiting_s > MOST_BEHIND_S
        whole_samples = int(SLICE_S * self._bytes_per_s) // BYTES_PER_SAMPLE * BYTES_PER_SAMPLE
        n = len(first) if skipped else min(len(first), whole_samples)
        data = bytes(first[:n])
        del first[:n]
        if not first:
            self._items.popleft()
        self._n_bytes -= n
        self._changed.set()
        return Chunk(data, skipped, arrived=self._last - self.waiting_s)

    async def _change(self) -> None:
        self._changed.clear()
        await self._changed.wait()
