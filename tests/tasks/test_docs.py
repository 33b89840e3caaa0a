"""Pages of tasks and constraints: one an item, nothing stale, examples that run, and limits that are stated."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from wbc import pages
from wbc.pages import docstring, example, folder
from wbc.pages.docstring import PageError
from wbc.stack.layout import Layout
from wbc.tasks import EndEffector, Hold, LineContact, RollingContact, SurfaceContact, Task

pytestmark = pytest.mark.usefixtures("loaded_once")

PAGES = Path(__file__).parents[2] / "docs" / "tasks"
NAMES = tuple(sorted(pages.page_name(cls) for cls in pages.shipped().values()))


def examples() -> list[tuple[str, str]]:
    found = []
    for name in NAMES:
        blocks = re.findall(r"```python\n(.*?)```", (PAGES / name).read_text(), flags=re.DOTALL)
        found += [(f"{name}-{k}", block) for k, block in enumerate(blocks)]
    return found


@pytest.mark.parametrize(("name", "code"), examples(), ids=[name for name, _ in examples()])
def test_example_runs(name: str, code: str) -> None:
    exec(compile(code, name, "exec"), {})


@pytest.mark.parametrize("name", NAMES)
def test_page_says_what_the_item_cannot_do(name: str) -> None:
    assert "\n## What it cannot do\n" in (PAGES / name).read_text()


def test_every_page_is_about_an_item() -> None:
    assert sorted(file.name for file in PAGES.glob("*.md")) == sorted([*NAMES, pages.INDEX])


def test_every_item_has_a_page_with_an_example_and_nothing_is_stale() -> None:
    assert pages.stale(PAGES) == [], "run make docs"


def test_the_gain_that_a_page_states_is_the_first_value() -> None:
    seen = 0
    for cls in pages.shipped().values():
        if issubclass(cls, Task):
            stack, entry = example.find(cls, pages.page_name(cls), (PAGES / pages.page_name(cls)).read_text())
            slot = Layout(stack).blocks[entry.name].slots.get("gain")
            if slot is not None and entry.item.gain is None:
                seen += 1
                assert slot.input.default == cls.default_gain, cls.__name__
    assert seen > 8


@pytest.mark.parametrize("cls", [SurfaceContact, LineContact, RollingContact])
def test_the_friction_of_a_page_is_that_of_the_rows(cls: type[SurfaceContact]) -> None:
    """The largest f_x that the rows allow beside f_z = 1 and nothing else."""
    page = (PAGES / pages.page_name(cls)).read_text()
    item = example.find(cls, pages.page_name(cls), page)[1].item
    cone = item.cone({"friction": ca.SX(0.6), "least": ca.SX(0.0), "most": ca.SX(1e3)})
    matrix, lower = (np.array(ca.DM(part)) for part in (cone.matrix, cone.lower))
    along, pressing = matrix[1:, 0], matrix[1:, 2]
    most = min(-pressing[k] / along[k] for k in np.flatnonzero(along < 0.0))
    assert not lower.any()
    assert most == pytest.approx(0.6 / np.sqrt(2.0))
    assert "mu = friction / sqrt(2)" in page


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
    assert [a for a, b in zip(after.splitlines(), before.splitlines(), strict=True) if a != b] == [
        "| `gain` | number or None | None | first value of the input `gain` [1/s]; None: 3.5 |"
    ]


def test_text_outside_the_marks_is_left_alone(copy: Path) -> None:
    page = copy / "hold.md"
    before = page.read_text()
    marked = folder.MARKED.sub(f"{folder.BEGIN}\n{folder.END}\n", before)
    page.write_text(marked.replace("# Hold", "# Hold fast"))
    assert "hold.md" in pages.update(copy)
    assert page.read_text() == before.replace("# Hold", "# Hold fast")


def test_a_docstring_that_states_another_default_is_refused(copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EndEffector, "__doc__", str(EndEffector.__doc__).replace("Default 0.", "Default 1."))
    with pytest.raises(PageError, match="its default is 1, and it is 0"):
        pages.stale(copy)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (folder.BEGIN, "", "expected lines"),
        ("wbc.tasks.Hold(", "wbc.tasks.Elbow(", "no example"),
    ],
)
def test_a_page_that_lacks_something_is_refused(copy: Path, old: str, new: str, reason: str) -> None:
    page, before = copy / "hold.md", (copy / pages.INDEX).read_text()
    lines = [line for line in page.read_text().splitlines(keepends=True) if 'sole_link", "position"' not in line]
    page.write_text("".join(lines).replace(old, new))
    with pytest.raises(docstring.PageError, match=reason):
        pages.update(copy)
    assert (copy / pages.INDEX).read_text() == before


def test_an_item_without_page_is_refused(copy: Path) -> None:
    (copy / "hold.md").unlink()
    with pytest.raises(docstring.PageError, match="Hold has no page"):
        pages.stale(copy)


class Silent:
    """No formula here."""


class Documented:
    """A thing follows ``another`` one:

        e = x - :class:`y`     [m]

    More words.

    Inputs:
        as declared. Each needs a default.
        target: a place,
            in the world [m]. Default: here.

    Attributes:
        first, second: both; see :class:`wbc.tasks.Hold`.

    Raises:
        Error: never.
    """


def test_docstrings_are_read() -> None:
    found = docstring.read(Documented)
    assert found.opening == "A thing follows `another` one:\n\n    e = x - :class:`y`     [m]"
    assert found.summary == "A thing follows `another` one."
    assert found.inputs == {"target": "a place, in the world [m]. Default: here."}
    assert found.other_inputs == "as declared"
    assert found.attributes == dict.fromkeys(("first", "second"), "both; see `Hold`.")
    with pytest.raises(docstring.PageError, match="formula"):
        docstring.read(Silent)
