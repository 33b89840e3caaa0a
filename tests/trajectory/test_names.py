"""Public names of the package are what they are called, whatever has been imported before."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

import wbc.trajectory as trajectory


def test_no_module_hides_a_public_name() -> None:
    # Importing a module makes it an attribute of its package, which is found before names that are imported on use
    for module in pkgutil.iter_modules(trajectory.__path__):
        importlib.import_module(f"wbc.trajectory.{module.name}")
    assert [name for name in trajectory.__all__ if isinstance(getattr(trajectory, name), ModuleType)] == []
