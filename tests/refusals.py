"""What every test of a refused declaration asserts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from wbc.errors import WbcError


def assert_refused(call: Callable[[], Any], error: type[WbcError], text: str) -> None:
    """``call`` raises just this error, whose message contains ``text``."""
    with pytest.raises(WbcError) as caught:
        call()
    assert type(caught.value) is error
    assert text in str(caught.value)
