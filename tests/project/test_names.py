"""What ``wbc.`` offers to somebody who types it, and what stands behind the names that are imported late."""

from __future__ import annotations

import importlib
import types
import warnings
from dataclasses import dataclass

import pytest

import wbc
from wbc import lazy
from wbc.renamed import renamed

#: Everything that ``dir(wbc)`` shows
NAMES = {
    *("Controller", "Policy", "Stack", "Status", "Step", "Certificate", "Explanation", "Recording", "replay"),
    *("InverseKinematics", "Solution", "WbcError", "__version__"),
    *("analysis", "coordinates", "errors", "proximity", "resolvers", "robots", "shapes", "tasks"),
    *("teleop", "track", "trajectory", "viewer", "walking"),
}


def test_dir_shows_every_name_once() -> None:
    assert set(dir(wbc)) == NAMES
    assert len({name.lower().rstrip("s") for name in dir(wbc)}) == len(dir(wbc))
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


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="module 'wbc' has no attribute 'Stak'"):
        _ = wbc.Stak
    with pytest.raises(AttributeError):
        lazy.attach("wbc", wbc.__file__)("__wrapped__")


@pytest.mark.parametrize(
    ("package", "old", "new"),
    [
        ("trajectory", "Limits", "MotionLimits"),
        ("trajectory", "Certificate", "LawCertificate"),
        ("analysis", "Certificate", "RankCertificate"),
        ("analysis", "Witness", "RankWitness"),
        ("analysis", "Branch", "LocusBranch"),
        ("robots", "Arm", "WalkerArm"),
        ("track", "Moving", "MovingObstacle"),
        ("track", "Path", "TimedPath"),
        ("track", "Plan", "PathRun"),
    ],
)
def test_old_names_are_found_and_said_to_be_old(package: str, old: str, new: str) -> None:
    room = importlib.import_module(f"wbc.{package}")
    with pytest.warns(DeprecationWarning, match=f"wbc.{package}.{old} is wbc.{package}.{new} now"):
        found = getattr(room, old)
    assert found is getattr(room, new)
    assert old not in dir(room)


def test_old_arguments_and_fields_work_and_are_said_to_be_old() -> None:
    @renamed(told="progress")
    def work(one: int, *, progress: int = 0) -> tuple[int, int]:
        return one, progress

    @renamed(pull="fastest")
    @dataclass(frozen=True)
    class Kept:
        fastest: float = 1.0

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert work(1, progress=2) == (1, 2)
        assert Kept(2.0).fastest == Kept(fastest=2.0).fastest == 2.0
    with pytest.warns(DeprecationWarning, match="work: told is progress now"):
        assert work(1, told=2) == (1, 2)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="Kept: pull is fastest now"):
        old = Kept(pull=3.0)  # type: ignore[call-arg]
    with pytest.warns(DeprecationWarning, match="Kept.pull is Kept.fastest now"):
        assert old.pull == old.fastest == 3.0  # type: ignore[attr-defined]
    with pytest.raises(TypeError, match="both were given"):
        work(1, progress=2, told=3)  # type: ignore[call-arg]
