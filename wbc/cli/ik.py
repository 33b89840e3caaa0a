"""``wbc ik``: configurations that put a frame where it shall be."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from wbc.cli.scene import SceneOptions
from wbc.errors import InfeasibleError, RangeError

if TYPE_CHECKING:
    from wbc.ik import InverseKinematics, Solution
    from wbc.ik.answers import TargetAnswer
    from wbc.track.target_file import Target
    from wbc.validation import Array

#: Exit code where not every target was reached
UNSOLVED = 1


@dataclass(frozen=True)
class Solve(SceneOptions):
    """Find joint positions that put a frame at a pose or a position.

    Clear of obstacles and within the limits. Of the configurations of a redundant arm those nearest to --start are
    preferred. Exit code 1 if a target is not reached; the nearest configuration and what binds are printed then.

    Example: wbc ik ur5 --target 0.4,0.2,0.5,1,0,0,0 --floor -0.1 --branches --out q.csv
    """

    PANEL: ClassVar[str] = "How it searches, and what it writes"
    target: Annotated[tuple[str, ...], "X,Y,Z or X,Y,Z,QX,QY,QZ,QW in the world [m]; may be repeated."] = ()
    targets: Annotated[Path | None, "CSV file with columns x,y,z[,qx,qy,qz,qw], or npz file with poses."] = None
    branches: Annotated[bool, "All configurations, not only the first one."] = False
    seed: Annotated[int, "Of the random configurations to start from."] = 0
    budget: Annotated[float | None, "Time for each target [s]. Default: until the restarts are used up."] = None
    restarts: Annotated[int | None, "Random configurations. Default: 100, with --branches 500."] = None
    tolerance: Annotated[float, "Of each component [m, rad]."] = 1e-5
    out: Annotated[Path | None, "CSV or npz file with all configurations."] = None
    force: Annotated[bool, "Write over a file that is there."] = False

    def run(self) -> int:
        from wbc.cli.answers import check_output, given_targets, report
        from wbc.cli.console import OutputError, data
        from wbc.ik.answers import save_answers

        check_output(self.out, self.force)
        wanted = given_targets(self.target, self.targets)
        plan = self.planned()
        for name, obstacle in plan.obstacles.items():
            if obstacle.velocity.any():
                raise RangeError(name, obstacle.velocity, "there is no time here: leave the velocity out")
        solver = plan.stack().inverse_kinematics(goals=("hand",), backend=self.backend)
        answers = [
            answer for number, one in enumerate(wanted, 1) for answer in self._answers(solver, plan.start, number, one)
        ]
        report(plan.robot, plan.frame, answers)
        data([answer.data() for answer in answers])
        if self.out is not None:
            from wbc import validation

            with validation.writing("out", self.out, OutputError):
                save_answers(self.out, plan.robot, answers)
        return 0 if all(answer.solved for answer in answers) else UNSOLVED

    def _answers(self, solver: InverseKinematics, first: Array, number: int, target: Target) -> list[TargetAnswer]:
        """What was found for one target, or the nearest configuration."""
        import numpy as np

        from wbc.ik.answers import TargetAnswer
        from wbc.ik.hindrance import hindrance

        given: dict[str, Any] = {"seed": self.seed, "budget": self.budget, "tolerance": self.tolerance}
        if self.restarts is not None:
            given["restarts"] = self.restarts
        hand = solver["hand"]
        hand.target = target.pose
        hand.mask = np.array([1.0] * 3 + [float(target.oriented)] * 3)
        found: tuple[Solution, ...] = (solver.solve(first, **given),)
        if self.branches and found[0].solved:
            # Where the time ends before the first of all branches, there is the one answer
            with contextlib.suppress(InfeasibleError):
                found = solver.branches(first, **given).solutions
        why = None if found[0].solved else hindrance(solver, first, **given)
        return [TargetAnswer(number, k, solution, target.oriented, why) for k, solution in enumerate(found, 1)]
