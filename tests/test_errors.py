"""One hierarchy of errors, and what every message says."""

from __future__ import annotations

import copy
import importlib
import pickle
import pkgutil

import numpy as np
import pytest

import wbc
from wbc import errors
from wbc.errors import UnknownNameError, WbcError


def all_errors() -> list[type[Exception]]:
    """Every exception class that a module of the package defines."""
    found = set()
    for info in pkgutil.walk_packages(wbc.__path__, "wbc."):
        module = importlib.import_module(info.name)
        found |= {
            kind
            for kind in vars(module).values()
            if isinstance(kind, type) and issubclass(kind, Exception) and kind.__module__.startswith("wbc")
        }
    return sorted(found, key=lambda kind: kind.__qualname__)


def make(kind: type[WbcError], value: object = -3.5) -> WbcError:
    choices = ("betas", "zeta", "beta")
    if issubclass(kind, UnknownNameError):
        return kind("hand.alpha", value, choices)
    return kind("hand.alpha", value, "expected something else", choices)


def test_every_error_of_the_package_is_found_and_has_one_root() -> None:
    kinds = all_errors()
    assert set(kinds) >= {k for k in vars(errors).values() if isinstance(k, type) and issubclass(k, Exception)}
    assert len(kinds) >= 15
    assert wbc.WbcError is WbcError
    for kind in kinds:
        assert issubclass(kind, WbcError), kind
        assert kind.__doc__, kind


@pytest.mark.parametrize("kind", all_errors(), ids=lambda kind: kind.__name__)
def test_message_names_field_value_and_choices(kind: type[WbcError]) -> None:
    error = make(kind)
    assert (error.field, error.value) == ("hand.alpha", -3.5)
    assert str(error).startswith("hand.alpha: ")
    assert f": {error.reason} (got -3.5)" in str(error)
    assert str(error).endswith(f"valid: {', '.join(error.choices)}")
    assert sorted(error.choices) == ["beta", "betas", "zeta"]


@pytest.mark.parametrize("kind", all_errors(), ids=lambda kind: kind.__name__)
def test_errors_cross_processes(kind: type[WbcError]) -> None:
    error = make(kind, np.arange(3.0))
    for other in (pickle.loads(pickle.dumps(error)), copy.copy(error)):
        assert type(other) is kind
        assert str(other) == str(error)
        assert (other.field, other.choices) == (error.field, error.choices)
        assert np.array_equal(other.value, error.value)


def test_nearest_name_first_and_long_lists_are_cut() -> None:
    error = UnknownNameError("frame", "panda_hnd", ["panda_link0", "panda_hand", "base", "hand"])
    assert error.choices[0] == "panda_hand"
    assert "did you mean 'panda_hand'?" in str(error)
    many = UnknownNameError("joint", "j7", [f"joint{k}" for k in range(20)])
    assert len(many.choices) == 20
    assert many.choices[0] == "joint7"
    assert str(many).endswith("... 12 more")
    assert "joint7, " in str(many)
    nothing = UnknownNameError("item", "hand", [])
    assert nothing.choices == ()
    assert "valid" not in str(nothing)


def test_long_values_are_cut() -> None:
    error = errors.ShapeError("q", np.arange(1000).tolist(), "expected shape (7,)")
    assert len(error.value) == 1000
    assert len(str(error)) < 200
    assert str(error).endswith("...)")
