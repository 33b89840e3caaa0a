"""Functions stay on the virtual machine: compiling takes longer than what they are called for here."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from wbc.native import toolchain


@pytest.fixture(scope="module", autouse=True)
def _no_compiler() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(toolchain, "missing", lambda: ("no C compiler",))
        yield
