"""The ten programs beside those of peers: at most as long, and each says when it fails."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

from bench.programs import PROGRAMS, Program, arguments, length


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda p: p.name)
def test_a_program_is_at_most_as_long_as_its_peers(program: Program) -> None:
    assert length(program.ours) <= length(program.theirs)
    for path in (program.ours, program.theirs):
        assert program.display or "raise SystemExit(" in path.read_text()
        ast.parse(path.read_text())


def test_lines_of_code_are_what_is_left_without_words(tmp_path: Path) -> None:
    text = (
        '"""About."""\n\n# why\nx = 1  # one\n\n\ndef f():\n    """Two\n    lines."""\n    return (\n        x\n    )\n'
    )
    (tmp_path / "a.py").write_text(text)
    assert length(tmp_path / "a.py") == 5


def test_a_peer_gets_the_neutral_configuration(tmp_path: Path) -> None:
    file, *words = arguments(next(p for p in PROGRAMS if p.robot == "tiago_no_hand"), tmp_path)
    assert Path(file).exists()
    assert dict(zip(words[::2], words[1::2], strict=True))["arm_1_joint"]
