"""A robot's body, and its compiled stack, are found once a process: reading the meshes of one takes 1 s to 3 s."""

from __future__ import annotations

import functools
from typing import Any

import pytest

from wbc.retarget import retargeter, robot_body
from wbc.retarget.engine import Engine

_body_of = functools.cache(robot_body.body_of)
#: What an engine is made from -> it, and its body, which stays so that no other one has its place in memory
_engines: dict[Any, tuple[Engine, Any]] = {}


def _engine(body: Any, limbs: tuple[str, ...], options: Any, dt: float, *, head: bool = False) -> Engine:
    key = (id(body), limbs, options, dt, head)
    if key not in _engines:
        _engines[key] = Engine(body, limbs, options, dt, head=head), body
    return _engines[key][0]


@pytest.fixture(autouse=True)
def _made_once(loaded_once: None, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (retargeter, robot_body):
        monkeypatch.setattr(module, "body_of", _body_of)
    monkeypatch.setattr(retargeter, "Engine", _engine)
