"""Where nothing can be compiled distances are still measured, and the log says at what price."""

from __future__ import annotations

import logging

import numpy as np
import pinocchio as pin
import pytest

from tests.models import spherical_seven
from wbc.errors import CompileError
from wbc.native import toolchain
from wbc.proximity import Body, distances, native
from wbc.proximity.native import library
from wbc.shapes import Box, Sphere


def refuse(*_: object) -> None:
    raise CompileError("compiler", "cc", "failed: no room")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("compiler", lambda: None, "no C compiler"), ("kernel", refuse, "failed: no room")],
)
def test_coal_stands_in(
    name: str, value: object, said: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(toolchain if name == "compiler" else native, name, value)
    with caplog.at_level(logging.WARNING, "wbc"):
        assert library.__wrapped__() is None
    assert said in caplog.text
    monkeypatch.setattr(native, "library", library.__wrapped__)
    box = Body("box", "world", pin.SE3.Identity(), Box((0.2, 0.2, 0.2)))
    ball = Body("ball", "world", pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0])), Sphere(0.05))
    assert distances(spherical_seven(), [(box, ball)], spherical_seven().neutral) == pytest.approx([0.15], abs=1e-12)


def test_a_library_of_another_layout_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        native, "_Scene", type("_Scene", (native._Scene,), {"_fields_": [("more", native.ctypes.c_int)]})
    )
    with pytest.raises(CompileError, match="bytes"):
        library.__wrapped__()
