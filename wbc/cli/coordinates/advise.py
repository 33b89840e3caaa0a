"""``wbc coordinates advise``: the pair of coordinates that an arm is best commanded by, at one or many places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from rich.markup import escape

from wbc.cli.console import out, say, table, tell
from wbc.cli.coordinates.modes import ArmName, ModeName

#: What the best pair is to keep of the task's least singular value
GOALS = {"ssrms": 0.1, "spdm_arm": 0.3, "spdm": 0.3}
#: Pairs that an adviser's time is measured with
TIMED = 5
#: Time of a tick that an adviser is to stay below [us]
GOAL_TIME = 100
#: Turns of joints are shown from this on [rad]
SHOWN = 0.05


@dataclass(frozen=True)
class AdvisedArm:
    """An arm and a mode."""

    robot: ArmName
    mode: Annotated[ModeName, "Pairs of this mode."] = "M1"


@dataclass(frozen=True)
class Advise(AdvisedArm):
    """Say which pairs are well conditioned at a configuration.

    Where the next locus is, and which pair to use.
    """

    at: Annotated[str, "Joint coordinates with commas [rad, m]. Default: neutral."] = ""
    current: Annotated[str | None, "The pair in use: stay where none is much better."] = None
    exact: Annotated[bool, "Factor determinants for exact loci."] = True

    def run(self) -> None:
        import numpy as np

        from wbc.cli.scene import configuration
        from wbc.coordinates import Adviser, mode_pairs, parts

        machine = parts(self.robot).robot
        adviser = Adviser(machine, mode_pairs(self.robot, self.mode), exact=self.exact)
        q, rows = configuration(machine, "at", self.at), []
        for found in adviser.advise(q):
            turn = found.direction * found.distance
            shown = np.abs(turn) >= min(SHOWN, np.abs(turn).max())
            turns = ", ".join(f"{n} {x:+.2g}" for n, x, is_ in zip(machine.dof_names, turn, shown, strict=True) if is_)
            far = found.distance > np.pi
            where = "none within half a turn" if far else found.locus or f"{found.basis}: {turns}"
            figures = f"{found.sigma:.4f}", f"{found.ratio:.3f}", str(found.condition)
            rows.append((escape(found.pair), *figures, "none" if far else f"{found.distance:.3f}", escape(where)))
        heads = ("task | constraint", "sigma", "of the task", "condition", "distance", "to")
        shown_table = table(heads, rows, left=heads)
        shown_table.columns[0].no_wrap = False
        out().print(shown_table)
        out().print(f"use: [bold]{escape(adviser.recommend(q, self.current))}[/bold]")
        tell(
            "sigma: least singular value, metres over the arm's length; of the task: over that of the task alone; "
            f"condition: what loses its rank within {adviser.near:g} rad; distance in rad, exact to a joint's angle, "
            "else an estimate"
        )


@dataclass(frozen=True)
class Restrictions(AdvisedArm):
    """Say where pairs lose rank, as formulas."""

    def run(self) -> None:
        from wbc.coordinates import restriction_table

        say(restriction_table(self.robot, self.mode))


@dataclass(frozen=True)
class Survey(AdvisedArm):
    """Say how the best pair does at random configurations.

    Its least singular value over that of the task, and the time of asking.
    """

    count: Annotated[int, "Random configurations."] = 1000

    def run(self) -> None:
        from wbc.coordinates import Adviser, advice_time, mode_pairs, parts, survey_pairs

        machine, pairs = parts(self.robot).robot, mode_pairs(self.robot, self.mode)
        found = survey_pairs(machine, pairs, self.count)
        k = found.worst
        many = f"best of {len(pairs)} pairs at {self.count} configurations"
        say(f"{many}: least singular value over that of the task alone")
        goal = f" (goal {GOALS[self.robot]:g})" if self.robot in GOALS else ""
        say(f"minimum {found.ratios[k]:.3f}{goal}: {found.best[k]}, task {found.tasks[k]:.4f}")
        say(f"  --at={','.join(f'{x:.4f}' for x in found.states[k])}")
        say(", ".join(f"{100 * part:g} % below {found.quantile(part):.3f}" for part in (0.01, 0.1, 0.5)))
        some = pairs[:TIMED]
        spent = 1e6 * advice_time(Adviser(machine, some, exact=False))
        say(f"adviser of {len(some)} pairs: {spent:.0f} us a tick (goal {GOAL_TIME} us for {TIMED})")
