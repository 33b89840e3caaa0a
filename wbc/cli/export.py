"""``wbc export``: the tick of a robot as C."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, ClassVar

from wbc.cli.scene import Plane, SceneOptions


@dataclass(frozen=True)
class Export(SceneOptions):
    """Write one control cycle, QP solver included, as C99.

    With a header, build files and a check. The stack is that of `wbc track`: a hand that follows a target, a posture,
    joint limits, obstacles. Other stacks: controller.export in Python.
    """

    PANEL: ClassVar[str] = "What it writes"
    plane: Annotated[Plane, "Elbow plane; auto holds it if more than six joints move."] = "off"
    rate: Annotated[float, "Ticks a second [Hz]."] = 200.0
    gain: Annotated[float, "Gain of the hand [1/s]."] = 10.0
    iteration_cap: Annotated[int, "Iterations of the QP solver a tick at most; 0: no cap."] = 0
    out: Annotated[Path | None, "Folder. Default: ROBOT_tick."] = None
    states: Annotated[int, "States of the check."] = 1000
    solver_source: Annotated[bool, "The QP solver's source, fetched, in place of its library."] = False
    solver_archive: Annotated[Path | None, "The archive of that source, where there is no network."] = None
    force: Annotated[bool, "Replace an export that is there."] = False

    def run(self) -> None:
        import numpy as np

        from wbc.cli.console import say
        from wbc.controller import core_of

        plan = replace(self.planned(plane=(self.plane, 0.0), rate=self.rate), gain=self.gain)
        controller = plan.stack().compile(backend=plan.backend)
        controller.reset(plan.start)
        tick = core_of(controller).tick
        tick.q[:] = plan.start
        tick.check()
        for name, obstacle in plan.obstacles.items():
            controller[name].velocity = np.concatenate([obstacle.velocity, np.zeros(3)])
        if self.iteration_cap:
            controller.iteration_cap = self.iteration_cap
        place = self.out or Path(f"{plan.robot.name}_tick")
        source = self.solver_archive or self.solver_source
        controller.export(place, overwrite=self.force, solver_source=source, states=self.states)
        say(f"{place}: {plan.robot.name}, {plan.robot.nv} degrees of freedom; try `make -C {place} run`")
