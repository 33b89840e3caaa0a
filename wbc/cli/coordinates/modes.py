"""``wbc coordinates modes``: which pairs of coordinates an arm can be commanded by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from wbc.cli import completion
from wbc.cli.console import data, out, say, table, tell
from wbc.cli.reading import Option

if TYPE_CHECKING:
    from wbc.coordinates import CoordinatePair
    from wbc.coordinates.advice.modes import Mode

ArmName = Annotated[
    str,
    Option(
        "A name of `wbc coordinates` or `wbc robots`, or a URDF or MJCF file.", placed=True, complete=completion.robots
    ),
]
ModeName = Literal["M1", "M2", "M3", "M4", "M5", "M6", "M7", "M8"]


@dataclass(frozen=True)
class Modes:
    """Say in which modes arms can be commanded, and by which pairs.

    How many pairs, or what is missing; of one robot, which pairs.
    """

    robot: Annotated[
        str,
        Option("A name, or a URDF or MJCF file. Default: the published arms.", placed=True, complete=completion.robots),
    ] = ""
    markdown: Annotated[bool, "As the table of the documentation."] = False

    def run(self) -> None:
        from wbc.coordinates.advice.modes import Mode, mode_row, mode_table, table_text

        if self.robot:
            row = mode_row(self.robot)
            for mode, pairs in row.items():
                text = f"no {pairs}" if isinstance(pairs, str) else "; ".join(pair.name for pair in pairs)
                say(f"{mode.name} {mode.value}: {text}")
            data(_data(row))
            return
        known = mode_table()
        data({name: _data(found) for name, found in known.items()})
        if self.markdown:
            say(table_text(known))
            return
        rows = (
            (name, *("-" if isinstance(f, str) else str(len(f)) for f in found.values()))
            for name, found in known.items()
        )
        out().print(table(("robot", *(mode.name for mode in Mode)), rows, "Pairs by mode"))
        tell("; ".join(f"{mode.name} {mode.value}" for mode in Mode))
        tell("Any other arm works, too: wbc coordinates modes NAME or FILE")


def _data(found: Mapping[Mode, Sequence[CoordinatePair] | str]) -> dict[str, object]:
    """Mode -> names of its pairs, or what is missing."""
    return {
        mode.name: {"missing": pairs} if isinstance(pairs, str) else {"pairs": [pair.name for pair in pairs]}
        for mode, pairs in found.items()
    }
