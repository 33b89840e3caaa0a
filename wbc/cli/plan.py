"""``wbc plan``: a path to a pose or a configuration, clear of obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from wbc.cli.scene import SceneOptions

#: Exit code where no path was found
NO_PATH = 3


@dataclass(frozen=True)
class PlanPath(SceneOptions):
    """Plan a path to a target or a configuration, clear of obstacles and within the limits, and its law of motion.

    Every configuration that puts the frame at the target is a goal. Ends with 3 where no path is found in the time, and
    with 2 and the reason where start or goal is not free.

    Example: wbc plan panda --target 0.45,-0.45,0.3 --box 0.55,0,0.35,0.2,0.1,0.7 --out law.npz
    """

    PANEL: ClassVar[str] = "How it searches, and what it writes"
    target: Annotated[tuple[str, ...], "X,Y,Z or X,Y,Z,QX,QY,QZ,QW in the world [m]; repeated: one of them."] = ()
    to: Annotated[str | None, "Configuration to reach, numbers with commas [rad, m]."] = None
    box: Annotated[tuple[str, ...], "Obstacle X,Y,Z,SIDE,SIDE,SIDE [m]; may be repeated."] = ()
    seed: Annotated[int, "Of the samples."] = 0
    seconds: Annotated[float, "After which the search is over [s]."] = 10.0
    out: Annotated[Path | None, "npz file for the law of motion."] = None
    force: Annotated[bool, "Write over a file that is there."] = False

    def run(self) -> int:
        import numpy as np

        from wbc import shapes, tasks
        from wbc.cli.answers import check_output, parse_target
        from wbc.cli.console import data, say, tell
        from wbc.cli.reading import numbers
        from wbc.cli.scene import configuration
        from wbc.errors import RangeError, ShapeError
        from wbc.multibody import pin
        from wbc.plan import NoPathError

        if not self.target and self.to is None:
            raise RangeError("target", None, "expected --target or --to")
        check_output(self.out, self.force)
        setup = self.planned()
        stack = setup.stack()
        for k, text in enumerate(self.box, 1):
            given = numbers("box", text)
            if len(given) != 6:
                raise ShapeError("box", text, "expected X,Y,Z,SIDE,SIDE,SIDE")
            pose = pin.SE3(np.eye(3), given[:3])
            stack.add(tasks.Obstacle(shapes.Box(given[3:]), margin=self.margin, pose=pose), name=f"box{k}")
        if setup.robot.self_pairs:
            stack.add(tasks.SelfCollision(), name="self")
        targets = [parse_target(text) for text in self.target]
        if any(not target.oriented for target in targets):
            stack.add(tasks.EndEffector(setup.frame, kind="position"), name="place")
        goals: list[object] = [{"hand": t.pose} if t.oriented else {"place": t.pose.translation} for t in targets]
        if self.to is not None:
            goals.append(configuration(setup.robot, "to", self.to))
        planner = stack.planner()
        try:
            path = planner.plan(setup.start, goals, seed=self.seed, seconds=self.seconds)
        except NoPathError as error:
            tell(str(error))
            return NO_PATH
        law = path.law()
        say(
            f"{len(path.points)} configurations, {path.length:.3g} rad, found in {1e3 * path.seconds:.3g} ms; "
            f"{law.duration:.3g} s at full speed: {law.certificate}"
        )
        data({"q": path.q.tolist(), "length": path.length, "seconds": path.seconds, "duration": law.duration})
        if self.out is not None:
            law.save(self.out)
            say(str(self.out))
        return 0
