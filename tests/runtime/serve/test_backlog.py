"""Speech that waits: its order, its bounds, and when it is skipped."""

import asyncio

import pytest

from facecode.serve.backlog import MOST_ITEMS, Backlog, Chunk
from facecode.serve.protocol import Command

RATE = 1000


def taken(backlog):
    return asyncio.run(asyncio.wait_for(backlog.take(), 1))


async def has_room(backlog):
    try:
        await asyncio.wait_for(backlog.room(), 0.01)
    except asyncio.TimeoutError:
        return False
    return True


def put(backlog, seconds, now=0.0, byte=1):
    backlog.put(bytes([byte]) * round(2 * RATE * seconds), now)


def test_speech_comes_in_slices_and_in_order():
    backlog = Backlog(RATE, live=True)
    put(backlog, 0.02, byte=1)
    put(backlog, 0.23, byte=2)
    first, second, third = (taken(backlog) for _ in range(3))
    assert first.data == b"\x01" * 40 + b"\x02" * 160
    assert [len(c.data) for c in (second, third)] == [200, 100]
    assert backlog.waiting_s == 0


def test_commands_keep_their_place():
    backlog = Backlog(RATE, live=True)
    put(backlog, 0.05)
    backlog.order(Command("flush"))
    put(backlog, 0.04)
    assert len(taken(backlog).data) == 100
    assert taken(backlog) == Command("flush")
    assert len(taken(backlog).data) == 80


def test_all_that_waits_is_skipped_beyond_half_a_second_of_live_speech():
    backlog = Backlog(RATE, live=True)
    put(backlog, 0.5)
    assert not taken(backlog).skipped
    put(backlog, 0.2)
    found = taken(backlog)
    assert found.skipped
    assert len(found.data) == round(2 * RATE * 0.6)
    put(backlog, 0.02)
    assert not taken(backlog).skipped


def test_a_recording_is_never_skipped():
    backlog = Backlog(RATE, live=False)
    put(backlog, 1.9)
    assert not any(taken(backlog).skipped for _ in range(19))


def test_reset_forgets_what_waits():
    backlog = Backlog(RATE, live=True)
    put(backlog, 0.3)
    backlog.order(Command("flush"))
    backlog.order(Command("reset"))
    assert (taken(backlog), backlog.waiting_s) == (Command("reset"), 0)


def test_nothing_grows():
    async def fill():
        backlog = Backlog(RATE, live=True)
        put(backlog, 1.99)
        assert await has_room(backlog)
        put(backlog, 0.02)
        assert not await has_room(backlog)
        await backlog.take()
        assert await has_room(backlog)
        for _ in range(MOST_ITEMS):
            backlog.order(Command("flush"))
        assert not await has_room(backlog)

    asyncio.run(fill())


def test_room_is_told_to_who_waits():
    async def both():
        backlog = Backlog(RATE, live=False)
        put(backlog, 2.05)
        waiting = asyncio.create_task(backlog.room())
        await asyncio.sleep(0)
        assert not waiting.done()
        await backlog.take()
        await asyncio.wait_for(waiting, 1)

    asyncio.run(both())


def test_when_speech_arrived():
    backlog = Backlog(RATE, live=True)
    put(backlog, 0.1, now=7.0)
    put(backlog, 0.1, now=7.1)
    first, second = taken(backlog), taken(backlog)
    assert isinstance(first, Chunk)
    assert (first.arrived, second.arrived) == pytest.approx((7.0, 7.1))
