"""The message format: what is read, what is refused with which reason, what is written."""

from __future__ import annotations

import contextlib
import json
import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from wbc.errors import WbcError
from wbc.viewer.messages import FORMAT, LONGEST, MessageError, read, sent_pose, value_of, write


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
