"""What all sessions of a server share: the face, the workers, the places, the counts."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import TypeVar

import numpy as np

from facecode.animator import Animator
from facecode.errors import NoRigError
from facecode.live.stream import Stream
from facecode.serve.limits import UNOPENED, Limits
from facecode.serve.metrics import Metrics
from facecode.serve.protocol import Opening

T = TypeVar("T")
PRIMED_STYLES = 8
"""Whose past is animated before the first client comes."""


class House:
    """Belongs to one event loop; streams are computed in worker threads."""

    def __init__(self, face: Animator, limits: Limits, workers: int) -> None:
        """Take in at most `limits.sessions` at once, `workers` of them computed at a time.

        Raises:
            NoRigError: the bundle has no face units, so no weights to send.
        """
        if not face.gives_weights:
            raise NoRigError.to_write("frames of a server")
        self.face, self.limits, self.metrics = face, limits, Metrics()
        self._pool = ThreadPoolExecutor(workers, "facecode")
        self._unopened = 0
        # The first run of a graph takes longer than the others, and so does the first stream of a
        # style: let neither be a client's.
        for style in face.styles[:PRIMED_STYLES]:
            face.stream(style)
        face.stream().feed(np.zeros(face.manifest.sample_rate, np.float32))

    async def work(self, job: Callable[[], T]) -> T:
        """What `job` gives, made by a worker."""
        return await asyncio.get_running_loop().run_in_executor(self._pool, job)

    async def stream(self, opening: Opening) -> Stream:
        """A stream as a client wants it.

        Raises:
            StyleError, LookAheadError, StreamRateError.
        """

        def begin() -> Stream:
            stream = self.face.stream(
                opening.style,
                look_ahead_ms=opening.look_ahead_ms,
                rest_in_quiet=opening.rest_in_quiet,
            )
            stream.feed(np.zeros(0, np.int16), opening.sample_rate)
            return stream

        return await self.work(begin)

    @contextmanager
    def threshold(self) -> Iterator[bool]:
        """Stand in the door: whether there is room to say what one wants."""
        self._unopened += 1
        try:
            yield self._unopened <= UNOPENED
        finally:
            self._unopened -= 1

    @contextmanager
    def place(self) -> Iterator[bool]:
        """Take a place: whether there was one."""
        free = self.metrics.sessions < self.limits.sessions
        self.metrics.sessions += free
        try:
            yield free
        finally:
            self.metrics.sessions -= free
