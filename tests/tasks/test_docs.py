"""Pages of tasks and constraints: made from docstrings, nothing stale, examples that run."""

from __future__ import annotations

import shutil
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from wbc import pages
from wbc.pages import docstring, folder
from wbc.pages.docstring import PageError
from wbc.stack.declaration import Declaration, Entry
from wbc.stack.layout import Layout
from wbc.tasks import EndEffector, Hold, LineContact, RollingContact, SurfaceContact, Task
from wbc.tasks.base import Item

pytestmark = pytest.mark.usefixtures("loaded_once")

PAGES = Path(__file__).parents[2] / "docs" / "tasks"
NAMES = tuple(sorted(pages.page_name(cls) for cls in pages.shipped().values()))


def item_of(cls: type[Item]) -> tuple[Declaration, Entry]:
    """The item of the example in the docstring, and its stack."""
    return folder.example_of(cls, docstring.read(cls).example)


@pytest.mark.parametrize("cls", pages.shipped().values(), ids=lambda cls: cls.__name__)
def test_example_runs(cls: type[Item]) -> None:
    exec(compile(docstring.read(cls).example, cls.__name__, "exec"), {})


def test_every_page_is_about_an_item() -> None:
    assert sorted(file.name for file in PAGES.glob("*.md")) == sorted([*NAMES, pages.INDEX])


def test_every_item_has_a_page_with_an_example_and_nothing_is_stale() -> None:
    assert pages.stale(PAGES) == [], "run make docs"


def test_the_gain_that_a_page_states_is_the_first_value() -> None:
    seen = 0
    for cls in pages.shipped().values():
        if issubclass(cls, Task):
            stack, entry = item_of(cls)
            slot = Layout(stack).blocks[entry.name].slots.get("gain")
            if slot is not None and "gain" not in docstring.read(cls).inputs:
                seen += 1
                assert slot.input.default == cls.default_gain, cls.__name__
                assert f"`gain` {cls.default_gain:g} 1/s" in (PAGES / pages.page_name(cls)).read_text()
    assert seen > 8


@pytest.mark.parametrize("cls", [SurfaceContact, LineContact, RollingContact])
def test_the_friction_of_a_page_is_that_of_the_rows(cls: type[SurfaceContact]) -> None:
    """The largest f_x that the rows allow beside f_z = 1 and nothing else."""
    item = item_of(cls)[1].item
    cone = item.cone({"friction": ca.SX(0.6), "least": ca.SX(0.0), "most": ca.SX(1e3)})
    matrix, lower = (np.array(ca.DM(part)) for part in (cone.matrix, cone.lower))
    along, pressing = matrix[1:, 0], matrix[1:, 2]
    most = min(-pressing[k] / along[k] for k in np.flatnonzero(along < 0.0))
    assert not lower.any()
    assert most == pytest.approx(0.6 / np.sqrt(2.0))
    assert "mu = friction / sqrt(2)" in (PAGES / pages.page_name(cls)).read_text()


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The pages of two items only, so that the checks that follow take no time."""
    for name in ("end_effector.md", "hold.md", pages.INDEX):
        shutil.copy(PAGES / name, tmp_path / name)
    return tmp_path


@pytest.fixture(autouse=True)
def few(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if "copy" in request.fixturenames:
        monkeypatch.setattr(folder, "shipped", lambda: {"EndEffector": EndEffector, "Hold": Hold})


def test_changes_are_seen_and_written(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pages.update(copy)
    assert pages.stale(copy) == []
    before = (copy / "end_effector.md").read_text()
    monkeypatch.setattr(Task, "default_gain", 3.5)
    assert pages.stale(copy) == ["end_effector.md"]
    assert pages.update(copy) == ["end_effector.md"]
    after = (copy / "end_effector.md").read_text()
    assert after == before.replace("`gain` 2 1/s", "`gain` 3.5 1/s") != before


def test_a_page_names_other_items_and_pages_by_links(copy: Path) -> None:
    pages.update(copy)
    page = (copy / "hold.md").read_text()
    assert page.startswith("# Hold\n")
    assert "(../reach.md)" in page
    assert "[`EndEffector`](end_effector.md)" not in page
    (copy / "hold.md").unlink()
    assert pages.update(copy) == ["hold.md"]
    assert (copy / "hold.md").read_text() == page


def test_a_docstring_that_states_another_default_is_refused(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EndEffector, "__doc__", str(EndEffector.__doc__).replace("Default 0.", "Default 1."))
    with pytest.raises(PageError, match="its default is 1, and it is 0"):
        pages.stale(copy)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("What it cannot do: ", "", "no paragraph"),
        ("stack.add(", "(lambda *given, **named: given)(", "no such item"),
        ("        kind: ", "        sort: ", "no text for this field"),
        ("        target: ", "        goal: ", "no text for this input"),
    ],
)
def test_a_docstring_that_lacks_something_is_refused(
    copy: Path, monkeypatch: pytest.MonkeyPatch, old: str, new: str, reason: str
) -> None:
    before = (copy / pages.INDEX).read_text()
    assert old in str(Hold.__doc__)
    monkeypatch.setattr(Hold, "__doc__", str(Hold.__doc__).replace(old, new))
    with pytest.raises(docstring.PageError, match=reason):
        pages.update(copy)
    assert (copy / pages.INDEX).read_text() == before


class Silent:
    """No formula here."""


class Documented:
    """A thing follows ``another`` one:

        e = x - :class:`y`     [m]

    More words.

    What it cannot do: be
    ``long``.

    Inputs:
        as declared. Each needs a default.
        target: a place,
            in the world [m]. Default: here.

    Attributes:
        first, second: both; see :class:`wbc.tasks.Hold`.

    Example:
        >>> for k in range(2):
        ...     print(k)

    Raises:
        Error: never.
    """


def test_docstrings_are_read() -> None:
    found = docstring.read(Documented)
    assert found.opening == "A thing follows `another` one:\n\n    e = x - :class:`y`     [m]"
    assert found.summary == "A thing follows `another` one."
    assert found.inputs == {"target": "a place, in the world [m]. Default: here."}
    assert found.other_inputs == "as declared"
    assert (found.text, found.cannot) == ("More words.", "Be `long`.")
    assert found.example == "for k in range(2):\n    print(k)"
    assert found.attributes == dict.fromkeys(("first", "second"), "both; see `Hold`.")
    with pytest.raises(docstring.PageError, match="formula"):
        docstring.read(Silent)
