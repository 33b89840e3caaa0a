"""Dataclasses that are declared quickly answer as those of the standard library."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
import sys
import typing
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

from wbc import quick_dataclasses

Decorator = Callable[..., Any]
#: One array in two objects is equal to itself here; since Python 3.13 the standard library's comparison raises
SHARED = np.zeros(3) if sys.version_info < (3, 13) else None


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


def family(decorator: Decorator) -> list[type]:
    """A class, one that inherits of it, and one of the standard library that inherits of that."""

    @decorator(frozen=True)
    class Base:
        first: int
        plain: int = 2
        second: list[int] = dataclasses.field(default_factory=list)
        made: int = dataclasses.field(init=False, default=4)
        shared: ClassVar[int] = 7

        def __post_init__(self) -> None:
            object.__setattr__(self, "made", self.first + len(self.second))

    @decorator(frozen=True)
    class Child(Base):
        plain: float
        named: str = dataclasses.field(default="n", kw_only=True)
        last: tuple[int, ...] = ()
        hidden: Any = dataclasses.field(default_factory=dict, init=False)

    @dataclasses.dataclass(frozen=True)
    class Standard(Child):
        more: float = 0.5

    return [Base, Child, Standard]


def shape(of: type) -> list[Any]:
    """What a class says of itself, and the values of its objects."""
    fields = [(f.name, f.type, f.init, f.kw_only, f.default, f.default_factory) for f in dataclasses.fields(of)]
    given = of(3, 8, [1, 2]), of(first=1)
    values = [[getattr(thing, f.name) for f in dataclasses.fields(of)] for thing in given]
    own = {name: value for name, value in vars(of).items() if not name.startswith("_")}
    init: Any = vars(of)["__init__"]
    told = [str(inspect.signature(of)), typing.get_type_hints(of.__init__), fields, values, own, of.__match_args__]
    return [*told, init.__qualname__, init.__module__]


@pytest.mark.parametrize("which", range(3), ids=["base", "child", "of the standard library"])
def test_fields_parameters_and_values_are_those_of_the_standard_library(which: int) -> None:
    quick, standard = (family(d)[which] for d in (quick_dataclasses.dataclass, dataclasses.dataclass))
    assert shape(quick) == shape(standard)
    with pytest.raises(dataclasses.FrozenInstanceError):
        del quick(1).first
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'first'"):
        quick()


def test_init_is_written_for_an_object_or_a_signature() -> None:
    def written(of: type) -> bool:
        return inspect.isfunction(vars(of)["__init__"])

    base, child, _ = family(quick_dataclasses.dataclass)
    child(1)
    assert written(child)
    assert not written(base)
    assert str(inspect.signature(base)) == str(inspect.signature(family(dataclasses.dataclass)[0]))
    assert written(base)


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
    from wbc.qp.certificate import Certificate
    from wbc.tasks import Posture

    assert pickle.loads(pickle.dumps(Posture())) == Posture()
    slim = Certificate(*range(len(dataclasses.fields(Certificate))))
    assert pickle.loads(pickle.dumps(slim)) == slim
    with pytest.raises(dataclasses.FrozenInstanceError):
        slim.error_bound = 0.0  # type: ignore[misc]
