"""The stack as users know it: a declaration that compiles."""

from __future__ import annotations

import functools
import logging
import weakref
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from wbc import validation
from wbc.api.controller import Controller
from wbc.controller import core_of
from wbc.qp.solvers import require_solver
from wbc.stack.artifact import compile_stack
from wbc.stack.declaration import Declaration, bends
from wbc.tasks import Constraint, Fixed, FrameVelocityLimit, JointLimits
from wbc.tasks.mechanism import Mechanism

if TYPE_CHECKING:
    from wbc.ik import InverseKinematics, Solution
    from wbc.plan import MotionPlanner, PlannedPath

log = logging.getLogger("wbc")

#: Controllers that exist: what is added to their stacks later they do not have
_COMPILED: weakref.WeakKeyDictionary[Controller, weakref.ref[Stack]] = weakref.WeakKeyDictionary()


def base_is_free(stack: Declaration) -> bool:
    """A base that moves, and no item says how fast: no limit of its velocity, and nothing that holds the robot."""
    robot = stack.robot
    limited = bool(np.isfinite(robot.limits.velocity[: robot.base_nv]).any())
    for entry in stack.constraints:
        item = entry.item
        if isinstance(item, JointLimits) and item.velocity and limited:
            return False
        if isinstance(item, (FrameVelocityLimit, Fixed)):
            return False
        if getattr(item, "equality", False) and not isinstance(item, Mechanism):
            return False
    return robot.base_nv > 0


@functools.cache
def warn_free_base(robot: str, joint: str, numbers: str) -> None:
    """Say once for each robot what limits its base."""
    log.warning(
        "%s: nothing limits how fast its base moves; with robot = robot.with_limits(velocity={%r: [%s]}) in m/s and "
        "rad/s, stack.add(wbc.tasks.JointLimits()) does",
        robot,
        joint,
        numbers,
    )


def held_without_accelerations(stack: Declaration) -> str:
    """Name of the first item that holds a robot with a moving base while nothing limits accelerations; else empty."""
    items = [entry.item for entry in stack.constraints if isinstance(entry.item, Constraint)]
    if stack.command != "velocity" or stack.robot.base_nv == 0:
        return ""
    if any(np.isfinite(item.acceleration_limits(stack.robot)).any() for item in items):
        return ""
    return next((entry.name for entry in stack.constraints if bends(entry)), "")


@functools.cache
def warn_no_accelerations(robot: str, item: str) -> None:
    """Say once for each robot and item what makes joints change their rates from tick to tick as they like."""
    log.warning(
        "%s: nothing limits accelerations, so beside %r joints may reach any rate, and turn round, in one tick; "
        "with robot = robot.with_limits(acceleration=100.0) in rad/s^2, stack.add(wbc.tasks.JointLimits()) does",
        robot,
        item,
    )


class Stack(Declaration):
    """Tasks and constraints on a robot.

        stack = wbc.Stack(robot, dt=0.005)
        stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
        stack.add(wbc.tasks.JointLimits())
        controller = stack.compile()

    Args:
        robot: from :func:`wbc.robots.load`.
        dt: time between commands [s], > 0. ``step`` accepts ``dt_range``, a quarter to twice of it.
        damping: cost of velocity against a task row of weight 1, keeps the optimum unique (1e-12 to 1).
        length: characteristic length [m] that ties metres to radians; default: the robot's.
        calm: treat targets out of reach, and speeds that the joints cannot brake from, as docs/reach.md says; False:
            the plain linear model.

    Raises:
        ShapeError, RangeError, NotFiniteError: bad arguments.
    """

    def _was_added(self, name: str) -> None:
        if any(compiled() is self for compiled in list(_COMPILED.values())):
            log.warning("%r was added after compile(): controllers that exist do not have it; compile again", name)

    def compile(
        self, solver: str = "daqp", backend: str = "auto", command: str | None = None, wait: bool = False
    ) -> Controller:
        """A controller with its own memory; compiled code comes from the cache where it can.

        Args:
            command: what ticks command: ``velocity`` (default), ``acceleration`` or ``torque``. docs/torque.md.
            solver: ``daqp`` (native where gcc is), ``osqp``, ``qpoases``, or an experimental one.
            backend: ``native`` waits for gcc; ``vm``: rows on the CasADi virtual machine, all else in code that is
                compiled once for all stacks; ``auto``: ``vm`` at once, and where gcc is native code, which is compiled
                in the background: the controller changes over between two ticks, to the same bits
                (:attr:`Controller.tier`, :attr:`Controller.may_change`).
            wait: True: ``auto`` waits for the native code.

        Raises:
            UnknownNameError: unknown solver, backend or command. CompileError: native without gcc, or gcc failed;
                neither gcc nor code that was compiled ahead.
            CommandError: an item of the stack has no meaning for this command, and why.
        """
        from wbc import __version__

        require_solver(solver)
        wait = validation.flag("wait", wait)
        declared = self.commanding(self.command if command is None else command)
        controller = Controller(declared, compile_stack(declared, backend, __version__, wait=wait), solver)
        core_of(controller).fallback.prepare()
        # Of accelerations and torques the controller's own stack is a copy with more in it
        _COMPILED[controller] = weakref.ref(self)
        if base_is_free(self):
            joint = self.robot.joint_names[0]
            warn_free_base(self.robot.name, joint, ", ".join(["0.5"] * self.robot.base_nv))
        if item := held_without_accelerations(declared):
            warn_no_accelerations(self.robot.name, item)
        return controller

    def inverse_kinematics(self, goals: Iterable[str] | None = None, backend: str = "auto") -> InverseKinematics:
        """Inverse kinematics of these tasks and constraints, compiled; see :class:`wbc.InverseKinematics`.

        Args:
            goals: names of the tasks to be met within the tolerance, all others are followed as far as that costs these
                nothing; default: those of the greatest weight, postures and damping left out.
            backend: as for :meth:`compile`.

        Raises:
            UnknownNameError: unknown task or backend. RangeError: no goal is left. CompileError: see :meth:`compile`.
        """
        from wbc.ik import InverseKinematics

        return InverseKinematics(self, goals, backend)

    def solve(
        self,
        q0: Any,
        targets: Mapping[str, Any] | None = None,
        *,
        seed: int = 0,
        budget: float | None = None,
        restarts: int = 100,
        tolerance: float = 1e-5,
        goals: Iterable[str] | None = None,
        backend: str = "auto",
    ) -> Solution:
        """One configuration that meets the tasks: :meth:`inverse_kinematics` and its ``solve`` in one.

        Args:
            q0, targets, seed, budget, restarts, tolerance: as for :meth:`wbc.InverseKinematics.solve`.
            goals, backend: as for :meth:`inverse_kinematics`.

        Raises:
            WbcError: as these two.
        """
        kinematics = self.inverse_kinematics(goals, backend)
        return kinematics.solve(q0, targets, seed=seed, budget=budget, restarts=restarts, tolerance=tolerance)

    def planner(self, keep: Iterable[str] = ()) -> MotionPlanner:
        """A planner of paths on which every hard row of these constraints holds, kept for many queries.

        Args:
            keep: names of tasks whose errors stay 0 on every path, as a level cup or a tray between two hands.

        Raises:
            WbcError: as :class:`wbc.plan.MotionPlanner`.
        """
        from wbc.plan import MotionPlanner

        return MotionPlanner(self, keep)

    def plan(
        self, q0: Any, goal: Any, *, keep: Iterable[str] = (), seed: int = 0, seconds: float = 10.0
    ) -> PlannedPath:
        """A path from a configuration to a goal: :meth:`planner` and its ``plan`` in one; docs/plan.md.

            path = stack.plan(q0, {"hand": pose})
            law = path.law()

        Args:
            q0: where it begins [nq].
            goal: a configuration [nq], targets by task, or a list of these of which one is to be reached.
            keep: as for :meth:`planner`. seed: of the samples. seconds: after which the search is over [s].

        Raises:
            WbcError: as :meth:`wbc.plan.MotionPlanner.plan`.
        """
        return self.planner(keep).plan(q0, goal, seed=seed, seconds=seconds)
