"""What a controller needs on a robot besides steps: a cap on its iterations, and itself as C."""

from __future__ import annotations

from wbc import validation
from wbc.controller.native import NativeTick
from wbc.controller.solved import SolvedTick
from wbc.errors import RangeError, SolverError


class Deployment:
    """The part of :class:`wbc.Controller` that deadlines and exports need."""

    tick: NativeTick | SolvedTick
    solver: str
    backend: str

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
