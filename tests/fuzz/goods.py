"""Objects and arguments that are good: what random calls spoil."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import wbc
from tests.fuzz import operated
from tests.fuzz.arguments import GOOD
from tests.fuzz.arm import BOUNDS, DT, ONE, ROWS, TIP, Q, compiled, plain, robot, solvers, stack
from wbc import shapes, tasks, trajectory
from wbc.errors import CommandError
from wbc.robot import Robot
from wbc.robots import DHRow, LinkPair, SelfPairs, from_dh, operator_arm, walker
from wbc.trajectory import Law, Path as Way


class Goods:
    """Good arguments by the names of parameters, and objects whose methods are called.

    Args:
        folder: an empty folder, for files.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        law = trajectory.jerk_limited(np.zeros(3), Q, **BOUNDS)
        law.save(folder / "good.law")
        wbc.robots.save_self_pairs(wbc.robots.find_self_pairs(robot(), srdf=None, samples=20), folder / "pairs.toml")
        operated.files(folder)
        controller = self._controller()
        self._recorded(controller)
        line = trajectory.spline_path(np.array([np.zeros(3), Q, -Q]))
        poses = trajectory.geodesic_path(ONE, pin.SE3(pin.exp3(np.array([0.0, 0.0, 1.0])), np.ones(3)))
        step, plain_step = controller.step(Q), plain().compile(backend="vm").step(Q)
        found = solvers().solve(Q)
        #: name -> a maker: what calls may change is made anew
        self.subjects: dict[str, Callable[[], Any]] = {
            "robot": robot,
            "stack": stack,
            "plain stack": plain,
            "controller": self._controller,
            **{f"handle {n}": lambda n=n: self._controller()[n] for n in ("hand", "ball", "box", "height", "limits")},
            "step": lambda: step,
            "plain step": lambda: plain_step,
            "solver": solvers,
            "solution": lambda: found,
            "explanation": step.explain,
            "law": lambda: law,
            "pose law": lambda: trajectory.time_optimal(poses, np.ones(6), np.ones(6)),
            "limits": lambda: law.limits,
            "timing": lambda: law.timing,
            "path": lambda: line,
            "pose path": lambda: poses,
            "joint limits": lambda: robot().limits,
            "online": lambda: trajectory.online(3, DT, **BOUNDS),
            "dh": lambda: ROWS[0],
            "placed": lambda: robot().shapes["link1"][0],
            "pairs": lambda: SelfPairs("arm", (LinkPair(("link1", "link3"), True, "checked"),)),
            "operator": lambda: operator_arm("ssrms"),
            "walker": cache(walker),
            "recording": lambda: wbc.Recording(folder / "good.rec"),
            "policy": wbc.Policy,
            **operated.subjects(folder),
        }
        self._answers: dict[str, Any] = {}

    @staticmethod
    def _controller() -> wbc.Controller:
        controller = compiled().clone()
        controller.reset(Q)
        return controller

    def _recorded(self, controller: wbc.Controller) -> None:
        with controller.record(self.folder / "good.rec"):
            controller.step(Q)

    def harmed(self, subject: str) -> str:
        """What no longer works on the objects that are shared; empty: nothing."""
        probes = {
            "controller": lambda: compiled().clone().step(Q).v,
            "solver": lambda: solvers().solve(Q, seed=1, budget=None, restarts=3).q,
            "robot": lambda: robot().configuration("q", Q),
            "law": lambda: np.concatenate(self.subjects["law"]().at(0.1)),
            **operated.probes(),
        }
        probe = probes.get("controller" if "handle" in subject or subject == "step" else subject)
        if probe is None:
            return ""
        answer = np.asarray(probe())
        expected = self._answers.setdefault(subject, answer)
        return "" if np.array_equal(answer, expected) else "another answer than before"

    def value(self, callee: str, parameter: str) -> Any:
        """A good value of a parameter; None where none is known."""
        owner = callee.split(".")[0]
        for key in (f"{callee}.{parameter}", f"{owner}.{parameter}", parameter):
            for good in (GOOD, operated.GOOD):
                if key in good:
                    return good[key](self)
        return None

    def use(self, answer: Any, rng: np.random.Generator) -> None:
        """What an answer is for: declarations are compiled now and then, numbers are finite."""
        if isinstance(answer, tasks.Item):
            out = wbc.Stack(robot(), DT)
            out.add(answer, name="item")
            if rng.random() < 0.15:
                try:
                    controller = out.compile(backend="vm")
                    if isinstance(answer, tasks.MovingFrame):
                        # Nobody knows where it is until it is told
                        controller["item"].pose = (np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]))
                    _finite(controller.step(Q).v)
                except CommandError:
                    pass  # forces, which a stack of velocities has none of
                except wbc.WbcError as error:
                    raise AssertionError(f"passed add: {error}") from error
        elif isinstance(answer, wbc.Stack) and rng.random() < 0.15:
            _finite(answer.compile(backend="vm").step(Q).v)
        elif isinstance(answer, tasks.Input):
            tasks.Expression(lambda kin, p: kin.position(TIP), units="m", inputs=(answer,)).validate(robot())
        elif isinstance(answer, shapes.PlacedShape):
            robot().with_shapes({"link1": (answer,)})
        elif isinstance(answer, DHRow):
            from_dh([answer])
        elif isinstance(answer, Robot):
            out = wbc.Stack(answer, DT).add(tasks.JointLimits())
            if rng.random() < 0.1:
                _finite(out.compile(backend="vm").step(answer.neutral).v)
        elif isinstance(answer, wbc.Step):
            _finite(answer.v)
        elif isinstance(answer, Law):
            _finite(np.concatenate([part.ravel() for part in answer.at(0.5 * answer.duration)]))
            answer.certificate  # noqa: B018
        elif isinstance(answer, Way):
            _finite(answer.evaluate(np.array([0.5 * (answer.knots[0] + answer.knots[-1])])))
        elif isinstance(answer, trajectory.Online):
            _finite(answer.step().position)
        elif isinstance(answer, np.ndarray) and answer.dtype == np.float64:
            _finite(answer)
        elif type(answer).__name__ == "generator":
            next(answer, None)


def _finite(numbers: Any) -> None:
    if np.isnan(np.asarray(numbers)).any():
        raise ArithmeticError("NaN in an answer")
