"""Figures on pages: every block is what its file says, and every table of measured numbers stands in a block."""

from __future__ import annotations

import importlib
import pkgutil
import re
import subprocess
from pathlib import Path

import pytest

from bench import measured
from bench.figures import __main__ as command, index, pages, store
from bench.figures.index import FIGURES, Figure, render
from bench.sheet import Sheet
from tests.project.test_floors import FLOORS

ROOT = Path(__file__).parents[2]
PAGES = pages.all_pages()


@pytest.mark.parametrize("page", PAGES, ids=[p.stem for p in PAGES])
def test_blocks_are_what_their_files_say(page: Path) -> None:
    """``python -m bench.figures --write`` writes them."""
    text = page.read_text()
    assert pages.rendered(text, render) == text


@pytest.mark.parametrize("page", PAGES, ids=[p.stem for p in PAGES])
def test_measured_numbers_stand_in_blocks(page: Path) -> None:
    text = page.read_text()
    assert list(pages.loose(text)) == []
    assert [file for file in pages.named(text) if not (ROOT / file).is_file()] == []


def test_every_figure_is_on_a_page_and_measures_what_exists() -> None:
    shown = {block for page in PAGES for block in pages.BLOCK.findall(page.read_text())}
    for name, figure in FIGURES.items():
        wanted = set(figure.views)
        if not wanted and figure.path.is_file():
            wanted = set(store.read(figure.path)["parts"])
        assert {part for found, part in shown if found == name} == wanted or not wanted
        assert [path for path in figure.measures if not (ROOT / path).exists()] == []
        if not figure.command:
            assert (ROOT / "bench" / "measured" / f"{name}.py").is_file()
    assert {name for name, _ in shown} == set(FIGURES)


def test_every_producer_has_parts() -> None:
    producers = [
        importlib.import_module(f"bench.measured.{found.name}") for found in pkgutil.iter_modules(measured.__path__)
    ]
    assert len(producers) > 15
    without = [module.__name__ for module in producers if not callable(getattr(module, "parts", None))]
    assert without == ["bench.measured.ticks"], "what several of them share"


def test_the_page_of_the_architecture_has_every_part_on_its_floor() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text()
    rows = re.findall(r"^\| (\d+) \| (`[^|]+) \|", page, flags=re.MULTILINE)
    found = {name: int(floor) for floor, names in rows for name in re.findall(r"`([a-z_.]+)`", names)}
    assert found == FLOORS


def test_what_stands_in_no_block_is_found() -> None:
    table = "| | a |\n|---|---|\n| one | 3.5 us |\n"
    assert [line.split(":")[0] for line in pages.loose(table)] == ["3"]
    assert list(pages.loose("<!-- figures soft line -->\n\n" + table + "\n<!-- end -->\n")) == []
    assert list(pages.loose("<!-- by README.md -->\n\n" + table)) == []
    assert len(list(pages.loose("<!-- by README.md -->\n\nwords\n\n" + table))) == 1
    assert len(list(pages.loose("A tick takes 3 us on a 2-core machine.\n"))) == 1
    assert list(pages.loose("A tick of 5 ms; a table of `| 3.5 |`.\n")) == []


def test_a_file_of_figures_is_read_as_it_was_written(tmp_path: Path) -> None:
    about = {"commit": "abc", "date": "2026-01-02", "machine": "one"}
    store.write(tmp_path / "x.json", about, {"t": Sheet("", ("", "b"), [("c", "1.5 us")]), "s": "words"})
    data = store.read(tmp_path / "x.json")
    assert data["stamp"] == about
    assert store.shown(data["parts"]["t"]).splitlines()[-1] == "| c | 1.5 us |"
    assert store.shown(data["parts"]["s"]) == "words"
    assert store.signed(about, "make x") == "*`make x`, 2026-01-02, commit abc; one.*"


def test_a_figure_is_old_where_its_code_differs_from_its_commit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = ["git", "-c", "user.name=n", "-c", "user.email=e", "-C", str(tmp_path)]
    (tmp_path / "code.py").write_text("1")
    for arguments in (["init", "-q"], ["add", "."], ["commit", "-qm", "one"]):
        subprocess.run([*run, *arguments], check=True, capture_output=True)
    monkeypatch.setattr(store, "ROOT", tmp_path)
    monkeypatch.setattr(index, "ROOT", tmp_path)
    figure = Figure("x", ("code.py",), 1.0, ("make", "x"), "x.json")
    assert command.age(figure) == "never measured"
    store.write(figure.path, store.stamp(), {"s": "words"})
    assert command.age(figure) == ""
    (tmp_path / "code.py").write_text("2")
    assert command.age(figure) == "older than code.py"
    store.write(figure.path, store.stamp() | {"commit": "0123456"}, {"s": "words"})
    assert "not in this clone" in command.age(figure)
