"""The picture of the floors in docs/architecture.md, drawn from the table that a test holds imports to."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from bench.pool import ROOT

PICTURE = ROOT / "docs" / "images" / "floors.svg"
WIDTH, ROW, BOX = 1000, 44, 30
#: Size of the font [pixels]
SIZE = 12
#: Width of a letter, over the size of the font
WIDEST = 0.52
#: Letters of room that a name has in its box
BESIDE = 2
#: Colours of parts: what everybody uses, models, what is wanted, solving, what is built on it, the user's seat
COLOURS = ("#eceff1", "#e3f2fd", "#e8f5e9", "#fff8e1", "#fce4ec", "#ede7f6")
OF_FLOOR = (0, 0, 1, 2, 2, 3, 3, 4, 4, 4, 5)


def draw(floors: Mapping[str, int]) -> str:
    """SVG: a row a floor, the top one first."""
    height = ROW * (max(floors.values()) + 1) + 60
    body = [*house(floors, 30, WIDTH - 50, height - 20), text(33, 20, "wbc: imports only point down", "start")]
    size = f'viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" font-size="12"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    return "\n".join([head, f'<rect width="{WIDTH}" height="{height}" fill="white"/>', *body, "</svg>"]) + "\n"


def house(parts: Mapping[str, int], x: int, width: int, base: int) -> list[str]:
    """A row a floor above a base line."""
    out = []
    for floor in range(max(parts.values()) + 1):
        names = [name.removeprefix("wbc.") for name, level in parts.items() if level == floor]
        y, letters = base - ROW * (floor + 1), sum(len(name) + BESIDE for name in names)
        size = min(SIZE, (width - 8 * len(names)) / (WIDEST * max(letters, 1)))
        out.append(text(x - 6, y + 19, str(floor), "end"))
        place = float(x)
        for name in names:
            step = width * (len(name) + BESIDE) / letters
            out.append(
                f'<rect x="{place + 3:.0f}" y="{y}" width="{step - 6:.0f}" height="{BOX}" rx="4" '
                f'fill="{COLOURS[OF_FLOOR[min(floor, len(OF_FLOOR) - 1)]]}" stroke="#90a4ae"/>'
            )
            out.append(text(place + step / 2, y + 19, name, "middle", size))
            place += step
    return out


def text(x: float, y: float, words: str, anchor: str, size: float = SIZE) -> str:
    """A line of text; size: of the font [pixels]."""
    font = f' font-size="{size:.1f}"' if size < SIZE else ""
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}"{font}>{words}</text>'


def picture() -> str:
    """The picture as it should be."""
    from tests.project.test_floors import FLOORS

    return draw(FLOORS)


def write(path: Path = PICTURE) -> None:
    """Write it."""
    path.write_text(picture())
