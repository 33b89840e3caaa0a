"""``wbc climb``: any limbs on any scene, planned, carried out, checked and shown."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from wbc.cli.output import RECORDED, Mcap
from wbc.cli.scene import Backend, Force
from wbc.climb.request import ClimbRequest

#: Exit code where it does not arrive
NOT_THERE = 3
#: Exit code where the checker finds a violation
VIOLATED = 4


@dataclass(frozen=True)
class ClimbTo:
    """Climb or walk with any limbs: planned, carried out, checked and shown.

    Leaves log, check, figures, a picture and a film. Ends with 3 if it does not arrive, with 4 if the checker finds a
    violation; where no plan is found, with 2 and the reason in numbers.

    Example: wbc climb --robot anymal_c --scene stairs
    """

    request: Annotated[ClimbRequest, "What it does"]
    backend: Backend = "auto"
    check: Annotated[bool, "Run the checker."] = True
    mcap: Mcap = False
    pictures: Annotated[bool, "Draw picture and film."] = True
    out: Annotated[Path | None, "Run folder. Default: runs/climb-ROBOT-SCENE-TIME."] = None
    force: Force = False

    def run(self) -> int:
        from wbc.cli.console import progress_bar, say, tell
        from wbc.cli.folders import filled, recording, run_folder
        from wbc.climb import report
        from wbc.climb.loop import ClimbOutcome
        from wbc.climb.session import climb

        request = self.request
        name = f"climb-{Path(request.robot).stem}-{Path(request.scene).stem}"
        folder = run_folder(self.out, name, (*report.WRITTEN, *RECORDED), self.force, made=False)
        with progress_bar() as bar:
            bar.add_task(f"{request.robot} on {request.scene}", total=None)
            with contextlib.ExitStack() as stack:
                done = climb(request, self.check, self.backend, recording(stack, folder, self.mcap))
            figures = done.figures
            folder.mkdir(parents=True, exist_ok=True)
            with filled(folder, report.WRITTEN) as fresh:
                about = {"robot": request.robot, "scene": request.scene, **figures}
                written = report.write(done.run, done.report, about, fresh, self.pictures)
        run = done.run
        say(
            f"{request.robot} on {request.scene}: {run.outcome}{f', {run.reason}' if run.reason else ''} after "
            f"{run.log['t'][-1]:.2f} s; planned in {done.planning:.3g} s, {figures['real_time']:.3g} times real time"
        )
        violations = [] if done.report is None else done.report.violations
        for finding in violations:
            tell(str(finding))
        written += [folder / name for name in RECORDED if (folder / name).is_file()]
        say(f"{folder}: {', '.join(file.name for file in written)}")
        if violations:
            return VIOLATED
        return 0 if run.outcome is ClimbOutcome.ARRIVED else NOT_THERE
