"""``wbc published relative-motion``: published tables of the compensation of relative motion, and each of its parts."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from wbc.cli.reading import Option
from wbc.cli.scene import Force

if TYPE_CHECKING:
    from wbc.published.relative_motion.studies import Row

ARM = ("4.3", "4.4", "4.5", "4.6", "4.7", "4.8")


@dataclass(frozen=True)
class RelativeMotion:
    """Compensate relative motion.

    tables: largest errors in inches of each table's lines, as measured, by the published solve, and exactly. measuring:
    where the measuring arm says that the table is. holding: a hand on a table that sways. master-slave: two arms that
    meet, with backlash.

    Example: wbc published relative-motion --table 4.6
    """

    study: Annotated[Literal["tables", "measuring", "holding", "master-slave"], Option("See above.", placed=True)] = (
        "tables"
    )
    table: Annotated[Literal["4.3", "4.4", "4.5", "4.6", "4.7", "4.8"] | None, "tables: one. Default: all."] = None
    solves: Annotated[int, "tables: of the Jacobian along an exact line, 1 or more."] = 32
    angles: Annotated[
        tuple[float, float, float, float] | None, "measuring: q1,q2,q4,q6 of the arm [degrees]. Default: several."
    ] = None
    seconds: Annotated[float, "holding: time on the table [s]."] = 20.0
    period: Annotated[float, "holding, master-slave: a cycle [s]."] = 0.05
    share: Annotated[float, "master-slave: A, part of the way to the other arm in a cycle [1]."] = 0.7
    carried: Annotated[float, "master-slave: B, part of an arm's motion that goes on [1]."] = 0.4
    backlash: Annotated[float, "master-slave: of both arms [in]."] = 0.02
    out: Annotated[Path | None, "Run folder. Default: runs/relative-motion-TIME."] = None
    force: Force = False

    def run(self) -> None:
        from wbc.cli import console
        from wbc.cli.folders import filled, run_folder
        from wbc.published.relative_motion import MasterSlave, studies
        from wbc.published.relative_motion.printed import tables
        from wbc.published.relative_motion.studies import plot_lines

        if self.study == "tables":
            rows, said, summary = self._lines()
        elif self.study == "measuring":
            rows = studies.measuring(studies.READINGS if self.angles is None else [self.angles])
            told = "tables 4.1 and 4.2 [in]: largest errors as read, and with what both say of scales and axes"
            how = "the table [in, degrees] by the arm's geometry, and how far the published program is off"
            said = {how: rows, told: studies.registering()}
        elif self.study == "holding":
            rows = studies.holding(self.seconds, self.period)
            time = f"{self.seconds:g} s, cycles of {1e3 * self.period:g} ms"
            said = {f"largest errors on the table [in, degrees] in {time}": rows}
        else:
            rows = studies.coupled(MasterSlave(self.share, self.carried), self.backlash, self.period)
            how = f"A = {self.share:g}, B = {self.carried:g}; late: second half of the time"
            said = {f"how far apart both arms are [in], {how}": rows}
        if self.study != "tables":
            summary = {self.study: list(said.values())}
        written = ("summary.json", f"{self.study}.csv", *(["tables.png"] if self.study == "tables" else []))
        folder = run_folder(self.out, "relative-motion", written, self.force)
        with filled(folder) as fresh:
            with (fresh / f"{self.study}.csv").open("w", newline="") as stream:
                writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
                writer.writeheader()
                writer.writerows(rows)
            console.write_json(fresh / "summary.json", summary)
            if self.study == "tables":
                plot_lines(fresh / "tables.png", {name: tables()[name].modified[:, :3] for name in self._names()})
        for text, part in said.items():
            console.out().print(console.table(list(part[0]), (list(map(_shown, row.values())) for row in part)))
            console.say(text)
        console.say(folder)

    def _names(self) -> tuple[str, ...]:
        return ARM if self.table is None else (self.table,)

    def _lines(self) -> tuple[list[Row], dict[str, list[Row]], dict[str, object]]:
        """Rows of all lines; what is shown of them; their summary."""
        from wbc import validation
        from wbc.published.relative_motion.studies import lines_of

        rows = lines_of(self._names(), validation.integer("solves", self.solves, 1))
        largest = {
            name: {key: max(float(r[key]) for r in rows if r["table"] == name) for key in list(rows[0])[2:]}
            for name in self._names()
        }
        shown: list[Row] = rows if self.table else [{"table": name, **found} for name, found in largest.items()]
        how = f"largest error of x, y, z [in]; line: {self.solves} solves with feedback, end and way"
        return rows, {how: shown}, {"solves": self.solves, "inches": largest}


def _shown(x: str | float) -> str:
    return x if isinstance(x, str) else f"{x:.2g}" if 0.0 < abs(x) < 0.01 else f"{x:.3f}"
