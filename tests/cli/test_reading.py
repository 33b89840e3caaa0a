"""Options from dataclasses of other rooms: names, defaults, help, and what is read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import pytest

from wbc.cli.reading import Option, parser
from wbc.errors import ShapeError, UnknownNameError, WbcError


@dataclass(frozen=True)
class Place:
    """Where.

    Attributes:
        name: Of the place, in
            two lines [m].
        ways: On it; may be repeated.
        at: Coordinates [m].
    """

    name: str = "here"
    ways: tuple[Literal["up", "down"], ...] = field(default=(), metadata={"option": "way"})
    at: tuple[float, float] | None = None


@dataclass(frozen=True)
class Going:
    """Go there.

    Not back.
    """

    ends: tuple[str, str]
    what: Annotated[int | None, Option("How far [1].", placed=True)] = None
    place: Annotated[Place, "Where to"] = Place("there", at=(1.0, 2.0))
    quick: bool = False

    def run(self) -> int:
        """What was read."""
        seen.append(self)
        return 3 if self.quick else 0


seen: list[Any] = []


def run(*words: str) -> Any:
    """The exit code of a command line."""
    seen.clear()
    return parser("go", Going).main(list(words), standalone_mode=False)


def test_what_is_read_makes_the_dataclass() -> None:
    assert not run("--ends", "a", "b")
    assert seen == [Going(("a", "b"), place=Place("there", at=(1.0, 2.0)))]
    assert run("7", "--ends", "a", "b", "--way", "up", "--way", "down", "--at", "3,-4", "--quick") == 3
    assert seen == [Going(("a", "b"), 7, Place("there", ("up", "down"), (3.0, -4.0)), True)]


def test_help_comes_from_docstrings_and_annotations(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    run("--help")
    shown = " ".join(capsys.readouterr().out.split())
    texts = ("Go there. Not back.", "Of the place, in two lines [m].", "[default: there]", "1,2", "Where to", "--way ")
    assert [text for text in texts if text not in shown] == []


@pytest.mark.parametrize(
    ("words", "error", "match"),
    [
        (["--way", "upp"], UnknownNameError, "way: .*did you mean 'up'"),
        (["--at", "1,2,3"], ShapeError, "at: expected 2 numbers"),
        (["--at", "1;2"], ShapeError, "at: expected numbers"),
    ],
)
def test_what_is_none_is_named(words: list[str], error: type[WbcError], match: str) -> None:
    with pytest.raises(error, match=match):
        run("--ends", "a", "b", *words)
    assert seen == []
