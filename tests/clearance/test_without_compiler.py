"""Where nothing can be compiled clearances are proven in numpy, and the log says at what price."""

from __future__ import annotations

import logging

import numpy as np
import pinocchio as pin
import pytest

from tests.clearance.world import free_tree, still
from wbc.clearance import Pair, Sweeper, SweptBody, SweptScene, native, sweep
from wbc.clearance.native import library
from wbc.errors import CompileError
from wbc.native import toolchain
from wbc.shapes import Box, Sphere


def refuse(*_: object) -> None:
    raise CompileError("compiler", "cc", "failed: no room")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("compiler", lambda: None, "no C compiler"), ("kernel", refuse, "failed: no room")],
)
def test_numpy_stands_in(
    name: str, value: object, said: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(toolchain if name == "compiler" else native, name, value)
    with caplog.at_level(logging.WARNING, "wbc"):
        assert library.__wrapped__() is None
    assert said in caplog.text
    monkeypatch.setattr(sweep, "library", library.__wrapped__)
    bodies = [SweptBody("ball", Sphere(0.05), "universe"), SweptBody("box", Box((0.2, 0.2, 0.2)))]
    sweeper = Sweeper(SweptScene(free_tree(), bodies, [Pair("ball", "box", 0.1)]))
    assert not sweeper.native
    swept = sweeper.sweep(still(pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))), aim="least")
    assert swept.clear
    assert swept.found == pytest.approx([0.05], abs=1e-9)


def test_a_library_of_another_layout_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        native, "_Sweep", type("_Sweep", (native._Sweep,), {"_fields_": [("more", native.ctypes.c_int)]})
    )
    with pytest.raises(CompileError, match="bytes"):
        library.__wrapped__()
