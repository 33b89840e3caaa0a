"""Loops move no robot themselves: only a plant integrates what is commanded."""

from __future__ import annotations

import ast

import pytest

from tests.project.layout import ROOT, nodes, relative, sources

LOOPS = ("wbc/track", "wbc/teleop")


@pytest.mark.parametrize("folder", LOOPS)
def test_no_loop_integrates_rates(folder: str) -> None:
    files = [path for path in sources("wbc") if relative(path).startswith(f"{folder}/")]
    assert files, ROOT
    found = [
        f"{relative(path)}:{node.lineno}"
        for path in files
        for node in nodes(path)
        if isinstance(node, ast.Attribute) and node.attr in ("integrate", "difference")
    ]
    assert found == []
