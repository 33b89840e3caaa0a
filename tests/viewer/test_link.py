"""The memory between loop and viewer, and the messages that pass: nothing torn, lost, out of order or misread."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import os
import sys
import threading

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from wbc.errors import WbcError
from wbc.viewer.link import NOTE, RING, SLOTS, LoopEnd, ViewerEnd
from wbc.viewer.messages import FORMAT, LONGEST, MessageError, read, sent_pose, value_of, write


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


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "no JSON"),
        ("[1]", "no JSON object"),
        ('{"type": "sett"}', "set"),
        ('{"type": ["set"]}', "no type"),
        ('{"type": "set", "item": "hand"}', "values"),
        ('{"type": "set", "item": "hand", "values": 3}', "values"),
        ('{"type": "stop", "wbc": 2}', f"this is {FORMAT}"),
        (json.dumps({"type": "stop", "reason": "x" * LONGEST}), "longer"),
    ],
)
def test_what_is_no_message_is_refused(text: str, said: str) -> None:
    with pytest.raises(WbcError, match=said):
        read(text)


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_else(content: bytes) -> None:
    with contextlib.suppress(MessageError):
        assert read(content)["type"]


def test_what_is_written_is_json_without_nan() -> None:
    text = write({"a": [math.nan, np.inf, 1.23456789012], "b": np.array([1.0, np.nan]), "c": {"d": np.int64(3)}})
    assert json.loads(text) == {"a": [None, None, 1.234568], "b": [1.0, None], "c": {"d": 3}}


def test_a_pose_is_position_and_quaternion() -> None:
    numbers = np.concatenate([np.eye(3).ravel(order="F"), [1.0, 2.0, 3.0]])
    assert sent_pose(numbers) == [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0]
    assert value_of("pose", [1, 2, 3, 0, 0, 0, 1]) == ([1, 2, 3], [0, 0, 0, 1])
    assert value_of("vector", [1, 2, 3, 4, 5, 6, 7]) == [1, 2, 3, 4, 5, 6, 7]
