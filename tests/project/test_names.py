"""What ``wbc.`` offers to somebody who types it, and what stands behind the names that are imported late."""

from __future__ import annotations

import importlib
import importlib.util
import types

import pytest

import wbc
from tests.project.layout import module_name, sources
from wbc import lazy

#: Everything that ``dir(wbc)`` shows
NAMES = {
    *("Controller", "Policy", "Stack", "Status", "Step", "Certificate", "Explanation", "Recording", "Replay", "replay"),
    *("InverseKinematics", "SE3", "Solution", "WbcError", "__version__"),
    *("analysis", "coordinates", "errors", "proximity", "resolvers", "robots", "shapes", "tasks"),
    *("climb", "teleop", "track", "trajectory", "viewer"),
}


def test_dir_shows_every_name_once() -> None:
    assert set(dir(wbc)) == NAMES
    assert len({name.rstrip("s") for name in dir(wbc)}) == len(dir(wbc))
    assert all(getattr(wbc, name) is not None for name in dir(wbc))


@pytest.mark.parametrize(
    "name", ["wbc", "wbc.analysis", "wbc.coordinates", "wbc.robots", "wbc.track", "wbc.trajectory"]
)
def test_late_names_are_there_and_hide_no_module(name: str) -> None:
    package = importlib.import_module(name)
    assert sorted(dir(package)) == sorted(package.__all__)
    for public in set(package.__all__) - {"__version__"}:
        found = getattr(package, public)
        inner = f"{name}.{public}"
        assert isinstance(found, types.ModuleType) == (importlib.util.find_spec(inner) is not None), inner


def test_modules_are_found_without_being_listed() -> None:
    assert wbc.ik is importlib.import_module("wbc.ik")
    assert "ik" not in dir(wbc)


def test_no_name_of_a_package_is_that_of_a_module_in_it() -> None:
    packages = [
        path
        for path in sources("wbc", "tasks", "robots")
        if path.name == "__init__.py" and "lazy.attach" in path.read_text()
    ]
    assert len(packages) > 10
    for path in packages:
        package = importlib.import_module(module_name(path))
        for name in package.__all__:
            # Who imports the module makes it the package's attribute, in place of what has the name
            there = importlib.util.find_spec(f"{package.__name__}.{name}")
            assert there is None or getattr(package, name) is importlib.import_module(there.name), name


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'wbc' has no attribute 'Stak'"):
        _ = wbc.Stak
    with pytest.raises(AttributeError):
        lazy.attach("wbc", wbc.__file__)[0]("__wrapped__")
