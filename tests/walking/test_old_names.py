"""Modules of wbc.walking under the names that they had before the rooms."""

from __future__ import annotations

import importlib
import sys

import pytest

from wbc.walking.old_names import MOVED, keep_old_names


@pytest.mark.parametrize("old", MOVED)
def test_an_old_name_leads_to_the_module_and_says_so(old: str, monkeypatch: pytest.MonkeyPatch) -> None:
    new = importlib.import_module(MOVED[old])
    monkeypatch.delitem(sys.modules, old, raising=False)
    with pytest.warns(DeprecationWarning, match=f"{old} is now {MOVED[old]}"):
        assert importlib.import_module(old) is new
    assert new.__name__ == MOVED[old]


def test_other_names_are_not_found() -> None:
    keep_old_names()
    with pytest.raises(ModuleNotFoundError, match=r"wbc\.walking\.runlog"):
        importlib.import_module("wbc.walking.runlog")
    assert sum(type(finder).__name__ == "_OldNames" for finder in sys.meta_path) == 1
