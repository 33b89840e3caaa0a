"""Every test of this folder runs with the compiled sensor, and with what stands in for it without a compiler."""

from __future__ import annotations

import pytest

from wbc.proximity import native


@pytest.fixture(autouse=True, params=["compiled", "plain"])
def back_end(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Which of the two."""
    if request.param == "plain":
        monkeypatch.setattr(native, "library", lambda: None)
    else:
        assert native.library() is not None
    return str(request.param)
