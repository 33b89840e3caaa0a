"""Habits that every source file keeps. A rule tells each line that breaks it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.mutations import MUTATIONS
from tests.project.layout import FOLDERS, ROOT, nodes, relative, sources

PACKAGE = sources("wbc", "tasks", "robots", "bench")
EVERYTHING = sources(*FOLDERS)
#: Spelled apart so that this file passes its own rule
UNFINISHED = re.compile(r"\b(" + "|".join(("TO" + "DO", "FIX" + "ME", "X" + "XX", "HA" + "CK")) + r")\b")
#: Ways to read memory that no array of this process is known to own
FOREIGN = ("from_" + "address", "as_" + "strided", "string_" + "at")
#: What a docstring refers to of this package
REFERENCE = re.compile(r":(?:func|class|meth|data|attr|mod):`~?(?!casadi)([\w.]+)`")
SWITCHES = {"skip" + "if", "x" + "fail", "import" + "orskip"}


def unfinished(path: Path) -> Iterator[str]:
    """Marks of unfinished work, and errors that say that nothing is there."""
    text = path.read_text()
    for n, line in enumerate(text.splitlines(), 1):
        if UNFINISHED.search(line):
            yield f"{relative(path)}:{n}: {line.strip()}"
    for node in nodes(path) if "NotImpl" in text else ():
        if isinstance(node, ast.Raise) and "NotImpl" in ast.dump(node):
            yield f"{relative(path)}:{node.lineno}: raises"


def eager(path: Path) -> Iterator[str]:
    """Files with annotations that are evaluated."""
    lazy = "\nfrom __future__ import annotations\n" in path.read_text()
    if not lazy and any(isinstance(n, (ast.FunctionDef, ast.AnnAssign)) for n in nodes(path)):
        yield relative(path)


def foreign(path: Path) -> Iterator[str]:
    """Reads of memory through an address."""
    for n, line in enumerate(path.read_text().splitlines(), 1):
        if any(name in line for name in FOREIGN):
            yield f"{relative(path)}:{n}: {line.strip()}"


def switched_off(path: Path) -> Iterator[str]:
    """Tests that do not run."""
    # Most files have none of the words, and need not be parsed
    for n in nodes(path) if any(word in path.read_text() for word in SWITCHES) else ():
        if isinstance(n, ast.Attribute) and n.attr in SWITCHES:
            yield f"{relative(path)}:{n.lineno}: {n.attr}"


def test_nothing_is_left_unfinished() -> None:
    assert len(EVERYTHING) > 800
    assert [fault for path in EVERYTHING for fault in unfinished(path)] == []


def test_annotations_are_lazy() -> None:
    assert [fault for path in sources("wbc", "tasks", "robots") for fault in eager(path)] == []


def test_no_memory_is_read_through_an_address() -> None:
    """Where numbers of a C++ library stand in its memory is nobody's promise."""
    assert [fault for path in PACKAGE for fault in foreign(path)] == []


def test_no_test_is_switched_off() -> None:
    assert [fault for path in sources("tests") for fault in switched_off(path)] == []


def test_every_mistake_that_is_planted_has_one_place() -> None:
    """``python -m tests.mutations`` ends at one that has none."""
    places = {(mutation.file, mutation.right): (ROOT / mutation.file).read_text() for mutation in MUTATIONS}
    assert len(places) > 80
    assert [key for key, text in places.items() if text.count(key[1]) != 1] == []
    names = {name: (ROOT / "tests" / name).read_text() for mutation in MUTATIONS for name in mutation.tests}
    chosen = [(m.tests, word) for m in MUTATIONS if m.only for word in m.only.split(" or ")]
    assert [(t, word) for t, word in chosen if not any(re.search(rf"def test\w*{word}", names[n]) for n in t)] == []


def test_what_docstrings_refer_to_is_there() -> None:
    """By its last name: a class, function or value of this package, or a module."""
    files = sources("wbc", "tasks", "robots")
    names = {part for path in files for part in path.with_suffix("").parts} | {"dataclasses", "Name"}
    for path in files:
        for n in nodes(path):
            if isinstance(n, (ast.FunctionDef, ast.ClassDef)):
                names.add(n.name)
            elif isinstance(n, ast.Name | ast.Attribute) and isinstance(n.ctx, ast.Store):
                names.add(n.id if isinstance(n, ast.Name) else n.attr)
    asked = [(relative(path), name) for path in files for name in REFERENCE.findall(path.read_text())]
    assert len(asked) > 500
    assert [(path, name) for path, name in asked if name.split(".")[-1] not in names] == []


def test_the_rules_find_what_breaks_them(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("tests.project.layout.ROOT", tmp_path)
    bad = tmp_path / "bad.py"
    body = "    pass\n" * 80
    error = "NotImpl" + "ementedError"
    bad.write_text(
        f"# {'TO' + 'DO'}\n@pytest.mark.{'skip' + 'if'}(True)\ndef f(x: int):\n{body}    raise {error}\n" + FOREIGN[0]
    )
    assert [fault.split(":")[1] for fault in unfinished(bad)] == ["1", "84"]
    assert list(foreign(bad)) == [f"bad.py:85: {FOREIGN[0]}"]
    assert list(eager(bad)) == ["bad.py"]
    assert [fault.split(":")[1] for fault in switched_off(bad)] == ["2"]
