"""The memory between loop and viewer: nothing torn, nothing lost, nothing out of order."""

from __future__ import annotations

import itertools
import os
import sys
import threading

import numpy as np
from hypothesis import given, settings, strategies as st

from wbc.viewer.link import NOTE, RING, SLOTS, LoopEnd, ViewerEnd


def ends(state: int) -> tuple[LoopEnd, ViewerEnd]:
    loop = LoopEnd(state)
    return loop, ViewerEnd(os.dup(loop.file), state)


def test_the_newest_state_is_read_once() -> None:
    loop, viewer = ends(8)
    assert viewer.read() is None
    for k in range(1, 3 * SLOTS):
        loop.write(np.int64(k).tobytes(), 0.1 * k)
    state = viewer.read()
    assert state is not None
    assert (state.number, state.time, state.data) == (k, 0.1 * k, np.int64(k).tobytes())
    assert viewer.read(state.number) is None
    loop.close()
    loop.close()
    viewer.close()


def test_no_state_is_torn_while_the_loop_goes_on() -> None:
    size, seen = 1 << 14, []
    loop, viewer = ends(size)
    patterns = [bytes([k]) * size for k in range(256)]
    over = threading.Event()

    def write() -> None:
        for k in itertools.count(1):
            loop.write(patterns[k % 256], float(k))
            if over.is_set():
                break

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    writer = threading.Thread(target=write)
    writer.start()
    try:
        last = 0
        while len(seen) < 100:
            state = viewer.read(last)
            if state is not None:
                assert state.data == patterns[state.number % 256]
                assert state.time == state.number > last
                last = state.number
                seen.append(last)
    finally:
        over.set()
        writer.join()
        sys.setswitchinterval(before)
    loop.close()
    viewer.close()


@settings(max_examples=25)
@given(st.lists(st.tuples(st.binary(max_size=9000), st.booleans()), max_size=60))
def test_messages_come_whole_and_in_order(sent: list[tuple[bytes, bool]]) -> None:
    loop, viewer = ends(8)
    waiting: list[bytes] = []
    for content, take in sent:
        fits = sum(4 + len(one) for one in waiting) + 4 + len(content) <= RING
        assert viewer.send(content) == fits
        waiting += [content] * fits
        assert loop.waiting == bool(waiting)
        if take:
            assert list(loop.take()) == waiting
            waiting.clear()
    assert list(loop.take()) == waiting
    loop.close()
    viewer.close()


def test_silence_is_the_time_since_the_last_sign_of_life() -> None:
    loop, viewer = ends(8)
    viewer.live()
    assert 0.0 <= loop.silence < 5.0
    loop.put_flags(3)
    assert viewer.flags == 3
    loop.close()
    viewer.close()


def test_a_note_is_read_once_and_whole() -> None:
    loop, viewer = ends(8)
    assert viewer.noted(0) is None
    assert loop.note(b'{"gone":["1,2"]}')
    number, text = viewer.noted(0) or (0, b"")
    assert text == b'{"gone":["1,2"]}'
    assert viewer.noted(number) is None
    assert not loop.note(b"x" * NOTE)
    assert viewer.noted(number) is None
    assert loop.note(b"{}")
    assert (viewer.noted(number) or (0, b""))[1] == b"{}"
    loop.close()
    viewer.close()
