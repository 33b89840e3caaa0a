"""What a controller needs on a robot besides steps: a policy, a cap on its iterations, and itself as C."""

from __future__ import annotations

import os
import pathlib
from typing import TYPE_CHECKING, cast

from wbc import export, validation
from wbc.controller.native import NativeTick
from wbc.controller.policy import Policy
from wbc.controller.solved import SolvedTick
from wbc.controller.vectors import vectors
from wbc.errors import RangeError, ShapeError, SolverError

if TYPE_CHECKING:
    from wbc.controller.controller import Controller
    from wbc.controller.fallback import Fallback
    from wbc.controller.handle import Handle
    from wbc.controller.ramps import Ramps
    from wbc.controller.recorder import Recorder

#: How far an export's commands may be from those of the tick that it is [rad/s, m/s], and from those of another solver:
#: the native tick refines answers whose error it cannot bound by a tenth of that
SAME, SIMILAR = 1e-9, 1e-6


class Deployment:
    """The part of :class:`wbc.Controller` that deadlines and exports need."""

    tick: NativeTick | SolvedTick
    solver: str
    backend: str
    ramps: Ramps
    _slow: bool
    _fallback: Fallback
    _recorder: Recorder | None

    @property
    def policy(self) -> Policy:
        """What happens where rows conflict or an answer cannot be certified, see :class:`wbc.Policy`.

        Raises:
            ShapeError: no policy. SolverError: the controller records; a recording has one policy.
        """
        return self._fallback.policy

    @policy.setter
    def policy(self, policy: Policy) -> None:
        if not isinstance(policy, Policy):
            raise ShapeError("policy", policy, "expected a wbc.Policy")
        if self._recorder is not None:
            raise SolverError("policy", policy, "cannot change while the controller records")
        self._fallback.policy = policy

    def start_ramp(self, handle: Handle, weight: float, seconds: float) -> None:
        """See :meth:`Handle.ramp`."""
        self.ramps.start(handle, weight, seconds)
        self._slow = True

    def prepare(self) -> None:
        """Import and make now what the policy may need in a tick."""
        self._fallback.prepare()

    def finish(self, flag: int) -> int:
        """What the policy adds to a tick that ended with ``flag``; negative: refused."""
        return self._fallback.finish(flag)

    @property
    def iteration_cap(self) -> int | None:
        """Iterations of the QP solver that a tick may take, or None for as many as it takes (the default).

        A tick whose search the cap ends has the status ``capped``. It commands

            v = v_brake + s (v_found - v_brake),

        v_brake bringing every joint to rest as fast as its bounds allow, v_found the solver's last iterate, clipped
        into the bounds, and s in [0, 1] as large as no row leaves its sides by it. So bounds hold, rows that v_brake
        satisfies hold, and others are not missed by more than v_brake misses them. The next tick goes on from the
        active set that was reached. Rows of a warm start are put in without counting.

        Raises:
            RangeError: not None and no integer >= 1. SolverError: a cap where the tick is not native with daqp.
        """
        cap = int(self.tick.cap[0])
        return cap if cap > 0 else None

    @iteration_cap.setter
    def iteration_cap(self, cap: int | None) -> None:
        if cap is None:
            self.tick.cap[0] = 0.0
            return
        if isinstance(cap, bool) or not isinstance(cap, int):
            raise RangeError("iteration_cap", cap, "expected an integer >= 1, or None for no cap")
        validation.scalar("iteration_cap", cap, low=1.0)
        if not isinstance(self.tick, NativeTick):
            reason = f"only the native tick with daqp can be capped, this one is {self.backend} with {self.solver}"
            raise SolverError("iteration_cap", cap, reason)
        self.tick.cap[0] = float(cap)

    def export(
        self,
        folder: str | os.PathLike[str],
        *,
        overwrite: bool = False,
        solver_source: bool | str | os.PathLike[str] = False,
        states: int = 1000,
    ) -> pathlib.Path:
        """Write the tick as self-contained C99, with its QP solver, a header, build files and a check.

            controller.reset(q)
            controller.export("arm_tick")           # then: make -C arm_tick run

        The values that the controller has now (targets, gains, weights, switches, the cap) are those that the C code
        begins with. Nothing is compiled, and any backend will do; the C code is the native tick. docs/export.md.

        Args:
            folder: where to; it must be empty or not there.
            overwrite: an export that is there is replaced.
            solver_source: the solver's source in place of the library for this platform: True fetches it from the
                package index, or the path of its archive. Its hash is checked.
            states: how many states the check has, with this controller's commands; other backends than the native one
                give those of them that they solve with certainty.

        Raises:
            ExportError: the folder is not empty or cannot be written.
            SolverError: run-time values still wait for the first configuration.
            SolverSourceError: the solver cannot be had. RangeError: ``states`` is no integer >= 1.
        """
        from wbc import __version__

        me = cast("Controller", self)
        if isinstance(states, bool) or not isinstance(states, int) or not 1 <= states < 2**31:
            raise RangeError("states", states, "expected an integer >= 1")
        export.checked_folder(folder, overwrite)
        me.require_values()
        tick, layout, robot = self.tick, me.layout, me.stack.robot
        cost = me.row_costs.copy()
        for block in layout.of_form("task"):
            cost[block.span] *= block.entry.item.row_weights(robot)
        snapshot = export.Snapshot(
            me.stack,
            layout,
            tick.q.copy(),
            tick.p.copy(),
            tick.weight.copy(),
            cost,
            tick.enabled.copy(),
            tick.bound_enabled.copy(),
            float(tick.cap[0]),
            __version__,
            vectors(me, states),
            f"the {self.backend} tick with {self.solver}",
            SAME if self.backend == "native" and self.solver == "daqp" else SIMILAR,
        )
        return export.write(snapshot, folder, overwrite, solver_source)
