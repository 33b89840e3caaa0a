"""Dataclasses that are declared quickly answer as those of the standard library."""

from __future__ import annotations

import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from wbc import quick_dataclasses

Decorator = Callable[..., Any]
SHARED = np.zeros(3)


def declared(decorator: Decorator, **options: bool) -> type:
    """A class of the decorator; its name is that of every one."""

    class Sample:
        number: int
        name: str = dataclasses.field(default="a", repr=False)
        cache: Any = dataclasses.field(default=None, compare=False)
        array: Any = None

    Sample.__qualname__ = "Sample"
    return decorator(**options)(Sample) if options else decorator(Sample)


def answers(of: type) -> list[Any]:
    """What a class says of its objects."""
    one, same, other = of(1, array=SHARED), of(1, cache=3, array=SHARED), of(1, "b")
    said: list[Any] = [repr(one), one == same, one == other, one == 1, of.__match_args__, dataclasses.asdict(other)]
    said.append(dataclasses.replace(other, number=2) == of(2, "b"))
    for doing in (lambda: hash(of(1)) == hash(of(1, cache=2)), lambda: setattr(one, "number", 5)):
        try:
            said.append(doing())
        except (TypeError, AttributeError) as error:
            said.append(type(error))
    return said


@pytest.mark.parametrize(
    "options",
    [{}, {"frozen": True}, {"frozen": True, "eq": False}, {"eq": False}, {"frozen": True, "slots": True}],
    ids=str,
)
def test_answers_are_those_of_the_standard_library(options: dict[str, bool]) -> None:
    quick, standard = (answers(declared(d, **options)) for d in (quick_dataclasses.dataclass, dataclasses.dataclass))
    # Without a comparison of its own an object's text has its address only where it has no text either
    assert quick == standard


def test_own_methods_stay() -> None:
    @quick_dataclasses.dataclass(frozen=True)
    class Own:
        number: int

        def __repr__(self) -> str:
            return "own"

        def __eq__(self, other: object) -> bool:
            return True

        def __hash__(self) -> int:
            return 7

    assert (repr(Own(1)), Own(1) == Own(2), hash(Own(3))) == ("own", True, 7)


def test_a_text_that_contains_itself_ends() -> None:
    @quick_dataclasses.dataclass
    class Node:
        inner: Any = None

    node = Node()
    node.inner = node
    assert repr(node).endswith("Node(inner=...)")


def test_pickles_are_of_the_same_class() -> None:
    from wbc.tasks import Posture

    assert pickle.loads(pickle.dumps(Posture())) == Posture()
