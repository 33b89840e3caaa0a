"""From a step's copy of its tick to an :class:`Explanation`. Nothing here runs unless requested."""

from __future__ import annotations

import numpy as np

from wbc.explain.explanation import Contradiction, ExplainedBound, Explanation, Give, Residue
from wbc.explain.losses import groups, losses, prices
from wbc.explain.naming import Naming
from wbc.explain.past import PastTick
from wbc.explain.reasons import reasons
from wbc.qp.conflict import MET, Conflict, Infeasibility, diagnose
from wbc.qp.problem import QP
from wbc.stack.layout import Block, rate_unit
from wbc.tick.buffers import BENDS
from wbc.tick.outcome import certificates, scales
from wbc.validation import Array

_NONE = Residue(np.inf, "", "")


class Explainer:
    """Explains one past tick."""

    def __init__(self, past: PastTick) -> None:
        self.past = past
        self.naming = Naming(past)

    def explain(self, status: str, answered_by: str) -> Explanation:
        """The explanation; ``status`` and ``answered_by`` are the step's."""
        past = self.past
        v, multipliers = past.part("v"), past.part("multipliers")
        broken = past.broken()
        if broken:
            return Explanation(status, answered_by, broken, (), (), (), (), (), (), _NONE, _NONE, _NONE)
        found = self._infeasibility()
        least = tuple(
            Give(self._violated(row, v), float(amount * self.naming.units[row]))
            for row, amount in enumerate(found.slack)
            if amount > 1e-8
        )
        slack, nv = past.part("slack"), past.layout.variables
        given = tuple(Give(self._violated(nv + int(k), v), float(slack[k])) for k in np.flatnonzero(slack))
        # what a relaxation holds without a bound of its own does not bind
        has_bound = np.isfinite(past.qp.lower) | np.isfinite(past.qp.upper)
        pushing = [int(i) for i in np.flatnonzero((multipliers != 0.0) & has_bound)]
        binding = {i: self._binding(i, multipliers[i], v) for i in pushing if not self.naming.keeps_direction(i)}
        task_groups = groups(past)
        missed = losses(past, task_groups, v, self._culprits(pushing, multipliers))
        _, answer = past.solve()
        plain = answer is not None and answer.flag == "solved" and missed
        costs = prices(past, task_groups, answer, binding) if plain and answer is not None else ()
        return Explanation(
            status,
            answered_by,
            (),
            tuple(self._contradiction(conflict) for conflict in found.conflicts),
            least if found.conflicts else (),
            given,
            tuple(binding.values()),
            missed,
            costs,
            *self._residues(v, multipliers, status),
            tuple(
                (task, share)
                for task, share in scales(past.layout, v, past.part("error")).items()
                if share < 1.0 - 1e-6
            ),
            reasons(past, v, tuple(binding.values()), missed),
            self._lost(v),
            past.stack.robot.dead_points(past.tick.q),
        )

    def _lost(self, v: Array) -> tuple[Give, ...]:
        """What equality rows lose per second, as far as it is more than a thousandth of what counts as giving way."""
        rates, n = self.past.part("lost") / float(self.past.tick.dt[0]), self.past.layout.variables
        told = np.flatnonzero(np.abs(rates) > 1e-3 * BENDS * self.naming.units[n:])
        return tuple(Give(self._violated(n + int(k), v), float(abs(rates[k]))) for k in told)

    def _infeasibility(self) -> Infeasibility:
        """Conflicts of the QP in v / dof_scale and rows per unit."""
        qp, n, units = self.past.qp.hard(), self.past.layout.variables, self.naming.units
        A = qp.A * units[:n] / units[n:, None]
        return diagnose(QP(np.eye(n), np.zeros(n), qp.lower / units, qp.upper / units, A))

    def _contradiction(self, conflict: Conflict) -> Contradiction:
        bounds = tuple(self.naming.bound(*member) for member in conflict.bounds)
        units = np.array([self.naming.units[member.row] for member in conflict.bounds])
        enough = bool(np.isfinite(conflict.alone).any())
        needed = conflict.alone if enough else conflict.within
        alone = tuple(Give(s, float(a * u)) for s, a, u in zip(bounds, needed, units, strict=True))
        may = [k for k in range(len(bounds)) if np.isfinite(needed[k]) and not bounds[k].actuator]
        cheapest = alone[min(may or range(len(bounds)), key=lambda k: needed[k])]
        # of a minimal set, what one bound alone has to give is inverse to its multiplier in the proof
        pushes = 1.0 / np.maximum(conflict.within, MET)
        shares = tuple(float(push) for push in pushes / max(float(pushes.sum()), 1e-300))
        return Contradiction(bounds, tuple(g for g in alone if np.isfinite(g.amount)), enough, cheapest, shares)

    def _violated(self, row: int, v: Array) -> ExplainedBound:
        """The bound of a row that v misses, or is nearer to missing."""
        qp = self.past.qp
        at = float(qp.rows_at(v)[row])
        return self.naming.bound(row, at - qp.upper[row] > qp.lower[row] - at)

    def _binding(self, row: int, multiplier: float, v: Array) -> ExplainedBound:
        """The active bound; one that a relaxation holds may have a multiplier of the other sign."""
        qp, at = self.past.qp, v[row] if row < self.past.layout.variables else 0.0
        upper = multiplier > 0.0
        if row < self.past.layout.variables:
            upper = bool(abs(at - qp.upper[row]) < abs(at - qp.lower[row]))
        elif not np.isfinite((qp.upper if upper else qp.lower)[row]):
            upper = not upper
        return self.naming.bound(row, upper)

    def _culprits(self, rows: list[int], multipliers: Array) -> list[Block]:
        """Constraints that bind and tasks that are on."""
        past = self.past
        owners = [self.naming.owner(row, bool(multipliers[row] > 0.0)) for row in rows]
        constraints = {b.entry.name: b for b in owners if b is not None}
        tasks = [b for b in past.layout.of_form("task") if past.is_on(b)]
        return [*constraints.values(), *tasks]

    def _residues(self, v: Array, multipliers: Array, status: str) -> tuple[Residue, Residue, Residue]:
        """Residuals of the command as it was given; none for commands that are no optimum."""
        if status in ("braked", "capped"):
            return _NONE, _NONE, _NONE
        past, naming, nv = self.past, self.naming, self.past.layout.variables
        qp = past.qp
        slack = np.concatenate((np.zeros(nv), past.part("slack")))
        beyond = np.maximum(qp.violation(v) - slack, 0.0)
        gradient = np.abs(qp.H @ v + qp.g + multipliers[:nv] + qp.A.T @ multipliers[nv:]) / np.diag(qp.H)
        at = qp.rows_at(v)
        off = np.minimum(np.abs(at - qp.lower), np.abs(qp.upper - at))
        off = np.where((multipliers != 0.0) & (slack == 0.0), off, 0.0)
        robot = past.stack.robot
        out = []
        for values, named in ((beyond, True), (gradient, False), (off, True)):
            row = int((values / naming.units[: values.size]).argmax())
            own = not named and row < robot.nv
            where = robot.dof_names[row] if own else self.naming.bound(row, False).name if named else "slack"
            command = past.layout.command
            unit = rate_unit(robot.dof_units[row] if own else "rad", command)
            unit = self.naming.bound(row, False).unit if named else unit
            out.append(Residue(float(values[row]), unit, where if values[row] > 0.0 else ""))
        if past.layout.cascade:
            worst = max(certificates(past.layout, past.part), key=lambda level: level.stationarity)
            out[1] = Residue(
                worst.stationarity,
                rate_unit("rad", past.layout.command),
                "least velocity" if worst.level is None else f"level {worst.level}",
            )
        return out[0], out[1], out[2]
