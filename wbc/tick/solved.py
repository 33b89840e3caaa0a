"""A tick whose QP, which C has assembled, is solved by a solver that is called from Python."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wbc.qp.certificate import Certificate, certify
from wbc.qp.polishing import polish
from wbc.qp.problem import QP, QPSolution
from wbc.qp.relax import Relaxation, Relaxed
from wbc.qp.solvers import make_solver
from wbc.stack.codegen import PRICED, row_orders, row_units
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.stack.tables import brakes, reported_slacks
from wbc.tasks.base import SacrificeOrder
from wbc.tick.buffers import (
    BENDINGS,
    BENDS,
    BRAKED,
    EXACT,
    FIRMLY,
    INFINITE,
    KNOWN,
    OPENED,
    OPTIMAL,
    REFINED,
    RELAXED,
    REST_RATE,
    SHORTER,
    SOLVED,
    SOUND,
    STEEPER,
    STRETCHED,
    TOLERANCE,
    TURNING,
    UNSOUND,
    Buffers,
)
from wbc.tick.native import CompiledTick
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.qp.levels.hierarchy import LevelsAnswer
    from wbc.tick.levels import Levels

#: What an equality row in its unit may be missed by through the rounding of its own numbers
_ROUNDING = 1e-12
#: Corrections of the active set where a solver's answer has no certificate
POLISH_ROUNDS = 200
#: Price of what is held where it is a row, as in ``native/settings.h``, as are those below
HOLD_PRICE = 1e2
#: Price of limits of motion where these are rows
MOTION_PRICE = 1e-2
#: Cost that brings accelerations to rest
STEADY = 1e-4
#: Cost that brings wrenches to rest
WRENCH_STEADY = 1e-2
#: What a wrench off by its unit costs beside an acceleration off by its own where a tick has no answer; as there
WRENCH_SHARE = 1e-2
#: Of a tick that brakes
_NONE = Certificate(INFINITE, INFINITE, INFINITE, INFINITE)


class SolvedTick(Buffers):
    """Assembly, then a kept solver with its relaxation, then the certificate; see ``wbc/stack/native``."""

    def __init__(self, assembly: CompiledTick, stack: Declaration, layout: Layout, solver: str) -> None:
        self.assembly = assembly
        self.share(assembly)
        self._nv, self._velocities = layout.variables, layout.nv
        self._memory = Memory(layout)
        self._solver = make_solver(solver, layout.with_slacks, layout.general_rows)
        self._torques, self._commands_velocity = layout.command == "torque", layout.command == "velocity"
        slots, limits = brakes(stack, layout)
        self._brakes = np.array(slots, dtype=np.intp), limits
        self._orders = np.array(row_orders(layout), dtype=np.int_)
        self._elastic = layout.elastic
        price = class_prices(self._orders) if layout.elastic else None
        steady = np.zeros(layout.with_slacks)
        steady[: layout.variables], steady[: layout.nv] = WRENCH_STEADY, STEADY
        self._relaxation = Relaxation(layout.with_slacks, layout.general_rows, self._solver, price, steady)
        self._units = np.array(row_units(stack, layout), dtype=np.float64)
        scales = self._own_scales = layout.dof_scales(stack)
        self._longest = max(1.0, float(scales.max(initial=1.0)), float(self._units.max(initial=1.0)))
        wide = np.concatenate((scales, np.ones(layout.with_slacks - layout.variables)))
        self._dof_scales = None if (scales == 1.0).all() else wide
        self._soft, self._calm = SoftRows(stack, layout), stack.calm
        general = layout.of_form("margins", "rows")
        exact = [bool(getattr(block.entry.item, "exact", False)) for block in general for _ in block.rows]
        self._exact = np.array(exact, dtype=np.bool_)
        #: room that closed loops have in their rows, in units of these, see ``native/ease.h``
        self._room = 0.0
        self._hard = (np.array(layout.row_levels) < 0) & (np.array(layout.price_at) < 0)
        #: strict levels, None where there is one
        self.levels: Levels | None = None
        if layout.cascade:
            from wbc.tick.levels import Levels

            self.levels = Levels(assembly, stack, layout)

    def reset(self) -> None:
        self._solver.reset()
        if self.levels is not None:
            self.levels.reset()

    def check(self) -> int:
        return self.assembly.check()

    def qp(self) -> QP:
        return self.assembly.qp()

    @np.errstate(over="ignore", invalid="ignore")
    def step(self) -> int:
        refused = self.assembly.check()
        if refused:
            return refused
        self.v_in[:] = self.v_last
        return self.finish(self.assembly.qp(), hurries=True)

    def finish(self, qp: QP, hurries: bool = False) -> int:
        """Solve a QP of this layout and write the report; the flag, with ``UNSOUND`` where the certificate fails.
        Equality rows make up for what they lose within the tick; where that does not help, the step gets shorter.

        Args:
            hurries: what bounds on velocities let the command leave of errors makes another QP.
        """
        flag = self._answered(qp)
        if hurries and flag in (SOLVED, RELAXED) and self.assembly.hurries():
            qp = self.assembly.qp()
            flag = self._answered(qp)
        everything = flag == SOLVED
        worst = self.assembly.find_lost(everything)
        bends = worst > BENDS
        if worst > (STRETCHED if self._calm else BENDS) and flag in (SOLVED, RELAXED):
            # again, with the curvature of equality rows, and without counting on joints that bounds stop
            pushes = self.report[self._memory["multipliers"]][: self._nv] != 0.0
            self.stopped[:] = pushes & (qp.lower[: self._nv] != qp.upper[: self._nv])
            self.curving[0] = 1.0
            if not self._calm or self.stopped.any():
                qp = self.assembly.qp()
                flag = self._answered(qp)
        flag, worst = self._corrected(qp, flag, everything)
        for n in range(SHORTER):
            bent = self._bent_by(worst, OPENED) > 1.0 or (bends and n == 0 and self._turns_round())
            if flag not in (SOLVED, RELAXED) or not bent:
                break
            self.bend[:] = 0.0
            self.shortened[0] = STEEPER * self.shortened[0] or float((qp.H.diagonal() * self._own_scales**2).max())
            qp = self.assembly.qp()
            flag, worst = self._corrected(qp, self._answered(qp), everything)
        lost, dt = self.report[self._memory["lost"]], float(self.dt[0])
        if self._bent_by(worst, OPENED) > 1.0 and flag in (SOLVED, RELAXED):
            rates, most = np.abs(lost) / dt, np.where(self._exact, OPENED / dt, BENDS)
            slack = self.report[self._memory["slack"]]
            slack[:] = np.maximum(slack, np.where(rates > most * self._units, rates, 0.0))
            flag = RELAXED
            self.report[self._memory["flag"]] = flag
        self.assembly.look_ahead()
        self.assembly.commanded(self.report[self._memory["v"]], flag in (SOLVED, RELAXED))
        # closed loops may have passed limits on their way
        return int(self.report[self._memory["flag"]][0]) if flag == SOLVED else flag

    def _corrected(self, qp: QP, flag: int, everything: bool) -> tuple[int, float]:
        """Sides are moved until equality rows make up for what they lose, as far as that gets less: the flag, and what
        they lose then as a rate.
        """
        lost, dt = self.report[self._memory["lost"]], float(self.dt[0])
        worst = self.assembly.find_lost(everything)
        off = self._bent_by(worst, EXACT)
        for _ in range(BENDINGS if worst > BENDS else REFINED):
            if not off > 1.0 or flag not in (SOLVED, RELAXED):
                break
            before, last = off, self.bend.copy()
            qp = self._bent(qp, last - lost / dt)
            flag = self._answered(qp)
            worst = self.assembly.find_lost(everything)
            off = self._bent_by(worst, EXACT)
            if not off < before or flag not in (SOLVED, RELAXED):
                flag = self._answered(self._bent(qp, last))
                return flag, self.assembly.find_lost(everything)
        return flag, worst

    def _bent_by(self, worst: float, most: float) -> float:
        """How far rows are from what is allowed: ``worst`` of those that bend, and what exact ones miss, which may be
        ``most``, and what room they have.
        """
        missed = np.abs(self.report[self._memory["lost"]]) / self._units
        most += self._room * float(self.dt[0])
        return max(worst / BENDS, float(missed[self._exact].max(initial=0.0)) / most)

    def _turns_round(self) -> bool:
        """Whether a joint moves fast the other way than in the last tick."""
        now = self.report[self._memory["v"]][: self._velocities] / self._own_scales[: self._velocities]
        before = self.v_last[: self._velocities] / self._own_scales[: self._velocities]
        return bool(((now * before < 0.0) & (np.minimum(np.abs(now), np.abs(before)) > TURNING)).any())

    def _bent(self, qp: QP, bend: Array) -> QP:
        """The problem with both sides of its equality rows moved to where ``bend`` wants them."""
        out, n = qp.copy(), qp.n
        equal = qp.lower[n:] == qp.upper[n:]
        change = np.where(equal, bend - self.bend, 0.0)
        out.lower[n:] += change
        out.upper[n:] += change
        self.bend[equal] = bend[equal]
        self.assembly.move_sides(change)
        return out

    def _answered(self, qp: QP) -> int:
        """Solve a QP and write the report as far as it is about that."""
        wide = qp.with_slacks().definite()
        self.report[self._memory["beyond"]] = 0.0
        flag, x, answer = self.answer(wide)
        v, levels = self.below(qp, x[: self._nv], answer)
        memory, report = self._memory, self.report
        certificate, multipliers = _NONE, np.zeros(qp.lower.size)
        if answer is not None:
            self._name_frozen_bounds(qp, answer)
            if answer.added is not None:
                wide = replace(wide, H=wide.H + np.diag(answer.added[0]), g=wide.g + answer.added[1])
            if levels is None:
                multipliers = qp.rows_of(answer.multipliers)
                bounded = QP(wide.H, wide.g, *self._met(wide, answer, x), wide.A)
                certificate = certify(bounded, QPSolution(x, answer.multipliers, "solved"), self._velocities)
                if not (self._sound(certificate) and self._firm(qp, v, answer)):
                    found = polish(bounded, QPSolution(x, answer.multipliers, "solved"), POLISH_ROUNDS)
                    better = certify(bounded, found.solution, self._velocities)
                    if found.exact and self._sound(better):
                        certificate = better
                        x = np.clip(found.solution.x, bounded.lower[: wide.n], bounded.upper[: wide.n])
                        v, multipliers = x[: self._nv], qp.rows_of(found.solution.multipliers)
            elif self.levels is not None:
                multipliers = levels.multipliers
                bounded = QP(qp.H, qp.g, *self._met(qp, answer, v), qp.A)
                certificate = self.levels.certified(levels, float(bounded.violation(v).max(initial=0.0)))
        slack = qp.violation(v)[self._nv :] if flag == RELAXED else np.zeros(self._units.size)
        if self.levels is not None:
            slack = self.levels.with_soft(qp, v, slack)
        slack = self._soft.reported(qp, v, self.assembly.row_bounds(), slack) if answer is not None else slack
        slack = self.lacking(qp, v) if answer is None else slack
        rounding = 2.0 * np.where(self._exact, max(TOLERANCE, self._room), TOLERANCE)
        slack = np.where(slack > rounding * self._units, slack, 0.0)
        if flag == RELAXED and not (slack[self._hard].any() or report[memory["beyond"]].any()):
            flag = SOLVED  # the rows contradict each other by rounding only
        certificate = replace(certificate, violation=max(certificate.violation, self._broken(qp, v, answer)))
        sound = self._sound(certificate) and self._firm(qp, v, answer)
        for name in ("stationarity", "violation", "complementarity", "error_bound"):
            report[memory[name]] = min(getattr(certificate, name), INFINITE)
        report[memory["v"]] = v
        report[memory["flag"]] = flag
        iterations = 0 if levels is None else levels.iterations
        report[memory["iterations"]] = iterations + (answer.iterations if answer is not None else 0)
        report[memory["multipliers"]] = multipliers
        report[memory["slack"]] = slack
        if answer is None:
            return BRAKED + UNSOUND if self.assembly.usable and not self._proven(wide) else BRAKED
        return flag if sound else flag + UNSOUND

    def _broken(self, qp: QP, v: Array, answer: Relaxed | None) -> float:
        """By how much an answer breaks rows that never give way, by their own sides whatever it made of them."""
        firm = self._hard & (self._orders == 0)
        return 0.0 if answer is None else float(qp.violation(v)[qp.n :][firm].max(initial=0.0))

    def _firm(self, qp: QP, v: Array, answer: Relaxed | None) -> bool:
        """Whether those rows are broken by rounding only, as ``unsound`` in ``native/tick.c`` decides it."""
        return self._broken(qp, v, answer) <= FIRMLY * self._longest

    def _proven(self, qp: QP) -> bool:
        """Whether it is proven that rows which never give way contradict each other within the simple bounds."""
        firm = self._hard & (self._orders == 0)
        if not firm.any():
            return False
        crossed = self._uncrossed(qp)[1][firm].any()
        return bool(crossed) or self._relaxation.impossible(qp, firm, self._units, self._dof_scales)

    def _sound(self, certificate: Certificate) -> bool:
        """Whether a certificate holds, as ``unsound`` in ``native/tick.c`` decides it."""
        optimal = max(certificate.stationarity, certificate.complementarity) <= OPTIMAL
        known = optimal or certificate.error_bound <= KNOWN * self._longest
        return bool(known and certificate.violation <= SOUND * self._longest)

    def brake(self, qp: QP) -> None:
        """Every joint comes to rest as fast as its bounds allow; the report says so."""
        memory, report, v = self._memory, self.report, self.rest(qp)
        for name in ("stationarity", "violation", "complementarity", "error_bound"):
            report[memory[name]] = INFINITE
        report[memory["v"]], report[memory["flag"]] = v, BRAKED
        report[memory["iterations"]] = 0.0
        report[memory["multipliers"]], report[memory["slack"]] = 0.0, self.lacking(qp, v)
        self.assembly.find_lost(False)
        self.assembly.look_ahead()
        self.assembly.commanded(v, False)

    def rest(self, qp: QP) -> Array:
        """The command within the simple bounds that is nearest to rest; where a base floats as ``damp`` in
        ``native/solve.h`` has it.
        """
        nv = self._nv
        nearest = self.assembly.rest(qp.lower[:nv], qp.upper[:nv], self._coasting())
        if not self._elastic or not self.assembly.usable:
            return nearest
        low = qp.lower[qp.n :]
        equal = self._hard & (low == qp.upper[qp.n :])
        base = equal & (self._orders == 0)
        size = np.ones(nv) if self._dof_scales is None else self._dof_scales[:nv]
        A, cost = qp.A[:, :nv] * size, np.where(np.arange(nv) < self._velocities, 1.0, WRENCH_SHARE)
        count = int(base.sum())
        K = np.block([[np.diag(cost), A[base].T], [A[base], np.zeros((count, count))]])
        x = np.linalg.lstsq(K, np.concatenate((cost * nearest / size, low[base])), rcond=None)[0][:nv] * size
        return x if np.isfinite(x).all() else nearest

    def _coasting(self) -> Array:
        """Velocities of what has no acceleration limit: it stops together with the joint that takes longest."""
        out = np.zeros(self._nv)
        if self._commands_velocity:
            slot, limit = self._brakes
            slowly = slot >= 0
            slowly[slowly] = self.bound_enabled[slot[slowly]] != 0.0
            slowly, limit, speed = (
                slowly[: self._velocities],
                limit[: self._velocities],
                self.v_last[: self._velocities],
            )
            held = slowly & (speed != 0.0)
            share = (1.0 - limit[held] * self.dt[0] / np.abs(speed[held])).max(initial=0.0)
            out[: self._velocities] = np.where(slowly, 0.0, share * speed)
        return out

    def lacking(self, qp: QP, v: Array) -> Array:
        """By how much a tick of torques that brakes misses what no motion may cost: torques, and forces on a base."""
        if not self._torques:
            return np.zeros(self._units.size)
        missed = np.where(self._orders == 0, qp.violation(v)[qp.n :], 0.0)
        return np.where(missed > 2.0 * TOLERANCE * self._units, missed, 0.0)

    def _met(self, qp: QP, answer: Relaxed, v: Array) -> tuple[Array, Array]:
        """Bounds of the answer's problem without equality rows that v meets to rounding and that do not push.

        Rows that depend on each other have no common point to the last digit, so no bound could be stated with all of
        them. A minimiser over fewer rows that meets the others is the minimiser over all.
        """
        at = np.concatenate((v, qp.A @ v))
        rounding = _ROUNDING * np.concatenate((np.zeros(qp.n), self._units))
        met = (answer.lower == answer.upper) & (np.abs(at - answer.lower) <= rounding) & (answer.multipliers == 0.0)
        met[: qp.n] = False
        return np.where(met, -np.inf, answer.lower), np.where(met, np.inf, answer.upper)

    def below(self, qp: QP, v: Array, first: Relaxed | None) -> tuple[Array, LevelsAnswer | None]:
        """The command with all levels below the first, whose answer is v, and their answer; v where there are none."""
        if self.levels is None:
            return v, None
        return self.levels.below(qp, v, first, self.report)

    def _name_frozen_bounds(self, qp: QP, answer: Relaxed) -> None:
        """Of a bound that a relaxation holds, the other bound is not what binds, whatever sign its multiplier has."""
        n = self._nv
        frozen = (answer.lower[:n] == answer.upper[:n]) & (qp.lower[:n] != qp.upper[:n])
        at_lower = answer.lower[:n] == qp.lower[:n]
        self.report[self._memory["owner_high"]][frozen & at_lower] = -1.0
        self.report[self._memory["owner_low"]][frozen & ~at_lower] = -1.0

    def answer(self, qp: QP) -> tuple[int, Array, Relaxed | None]:
        """Flag, point and, unless the tick brakes, what the solver answered to a QP whose soft rows have slacks."""
        if self.assembly.usable:
            bounded, crossed = self._uncrossed(qp)
            if crossed[self._orders == 0].any():
                return BRAKED, self.rest(qp), None
            answer, limits = self._with_room(bounded)
            if answer.flag != "failed":
                answer = self._soft.polished(qp, answer)
                return RELAXED if crossed.any() or limits or answer.flag == "relaxed" else SOLVED, answer.x, answer
        return BRAKED, self.rest(qp), None

    def _with_room(self, qp: QP) -> tuple[Relaxed, bool]:
        """What a QP leads to, and whether limits of motion gave way: rows of closed loops are the last to do so."""

        def solved(qp: QP) -> Relaxed:
            return self._relaxation.solve(qp, self._orders, self._units, self._dof_scales, self._tends())

        answer, self._room = solved(qp), 0.0
        for limits in (False, True):
            if answer.flag == "solved" or (limits and not self._opened(answer)):
                break
            self._room, low, high = self.assembly.ease(limits)
            if self._room == 0.0:
                break
            eased = qp.copy()
            eased.lower[: self._nv], eased.upper[: self._nv] = low[: self._nv], high[: self._nv]
            eased.lower[qp.n :], eased.upper[qp.n :] = low[self._nv :], high[self._nv :]
            answer = solved(eased)
        else:
            return answer, True
        return answer, False

    def _opened(self, answer: Relaxed) -> bool:
        """Whether loops gave way, or there is no answer."""
        return answer.flag == "failed" or bool(answer.relaxed[self._exact].any())

    def _tends(self) -> Array | None:
        """What accelerations tend to where limits of motion give way."""
        if not self._elastic:
            return None
        out = np.zeros(self._solver.n)
        out[: self._velocities] = -REST_RATE * self.assembly.v_last[: self._velocities]
        return out

    def _uncrossed(self, qp: QP) -> tuple[QP, NDArray[np.bool_]]:
        """Rows whose bounds have crossed meet them as ``meeting`` of ``native/solve.h`` says; and which of them give
        way by more than rounding.
        """
        n = qp.n
        gap = qp.lower[n:] - qp.upper[n:]
        rows = np.flatnonzero(gap > 0.0)
        if not rows.size:
            return qp, np.zeros(gap.size, dtype=np.bool_)
        out, low, high, columns = qp.copy(), qp.lower[n + rows], qp.upper[n + rows], qp.A[rows] != 0.0
        moves = (self._orders[rows] > SacrificeOrder.HOLD) & (columns.sum(axis=1) == 1) & self._elastic
        moves &= columns[:, : self._velocities].any(axis=1)
        out.lower[n + rows] = out.upper[n + rows] = np.where(moves, np.clip(0.0, high, low), 0.5 * (low + high))
        return out, gap > 4.0 * TOLERANCE * self._units


def class_prices(orders: NDArray[np.int_]) -> Array:
    """What rows cost that give way at prices, by their classes; see ``native/relax.h``."""
    held, moves = orders == SacrificeOrder.HOLD, (orders > SacrificeOrder.HOLD) & (orders < PRICED)
    return np.where(held, HOLD_PRICE, np.where(moves, MOTION_PRICE, 0.0))


class SoftRows:
    """Soft rows of one layout."""

    def __init__(self, stack: Declaration, layout: Layout) -> None:
        self._rows = np.flatnonzero(np.array(layout.price_at, dtype=np.intp) >= 0)
        self._least = np.array(reported_slacks(stack, layout))[self._rows]

    def reported(self, qp: QP, v: Array, bounds: tuple[Array, Array], slack: Array) -> Array:
        """``slack`` of the general rows with the violations of those that are soft."""
        rows = self._rows
        if not rows.size:
            return slack
        at = qp.A[rows] @ v
        missed = np.maximum(bounds[0][rows] - at, at - bounds[1][rows])
        out = slack.copy()
        out[rows] = np.where(missed > self._least, missed, 0.0)
        return out

    def polished(self, qp: QP, answer: Relaxed) -> Relaxed:
        """The answer at rounding level, where there are soft rows: nearly dependent ones leave solvers less."""
        if not self._rows.size:
            return answer
        bounded = QP(qp.H, qp.g, answer.lower, answer.upper, qp.A)
        found = polish(bounded, QPSolution(answer.x, answer.multipliers, "solved"))
        if not found.exact:
            return answer
        n = qp.n
        x = np.clip(found.solution.x, answer.lower[:n], answer.upper[:n])
        return replace(answer, x=x, multipliers=found.solution.multipliers)
