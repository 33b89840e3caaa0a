"""What one step along the Jacobians cannot do, in numpy: mirrors ``native/reach.h``, formulas in docs/reach.md."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.program import TickProgram
from wbc.stack.tables import bent_rows, brakes, force_scales, gain_table, kept_rows, margin_table, rate_table, stops
from wbc.validation import Array

#: As in ``native/reach.h``
TRUSTED, AT_LIMIT, PUSHED, NEGLIGIBLE, LEAST_PIVOT, BRAKING = 2.0, 0.02, 0.01, 0.05, 1e-4, 1.0
REMOVED, TOO_FAR, CORRECTIONS = 0.02, 1e50, 2
SHARPENED, APART = 3, 1e6
#: As in ``native/settings.h``
FIRM = 1e4
#: As in ``native/margins.h``
BRAKING_MARGIN = 0.25
#: Squared length of a row that v cannot move, as in ``native/settings.h``
DEAD = 1e-20


#: Rows of unit length; the places of their forces behind those of the task rows; what of a force goes there
Firm = tuple[Array, NDArray[np.intp], Array]


class Reach:
    """Curvature of the errors that no step removes, and gains that leave margin to brake.

    Args:
        curve: weights of the task rows and of general rows -> curvature (nv x nv, symmetric); None: no task has any.
    """

    def __init__(
        self, stack: Declaration, layout: Layout, program: TickProgram, curve: Callable[[Array], Array] | None
    ) -> None:
        self._curve = curve
        #: curvature in the last QP, before anything made it positive definite; None for none
        self.curvature: Array | None = None
        self._gain_at = np.array(gain_table(layout), dtype=np.intp)[: layout.leading]
        self._force_scale = np.array(force_scales(stack, layout, program))[: layout.leading]
        self._dofs = layout.dof_scales(stack)
        self._damping = stack.damping / self._dofs**2
        places, self._brake_limit = brakes(stack, layout)
        self._brake_at = np.array(places, dtype=np.intp)
        stop_at, self._stop_low, self._stop_high = stops(stack, layout)
        self._stop_at = np.array(stop_at, dtype=np.intp)
        self._stop_q = np.zeros(layout.variables, dtype=np.intp)
        self._stop_q[: layout.nv] = np.maximum(stack.robot.position_index, 0)
        self._dof_count = layout.nv
        margins = np.array(margin_table(layout), dtype=np.intp)
        self._kept = np.array(kept_rows(layout), dtype=np.intp)
        self._bent = np.array(bent_rows(layout, program), dtype=np.bool_)
        self._tasks, self._calm, self._amended = layout.task_rows, stack.calm, False
        self._margin_rows = np.flatnonzero(margins >= 0)
        self._margin_at = margins[self._margin_rows]
        self._rate_at = np.array(rate_table(layout), dtype=np.intp)[self._margin_rows]

    def change(
        self,
        H: Array,
        J: Array,
        weight: Array,
        error: Array,
        desired: Array,
        q: Array,
        p: Array,
        equal: Array,
        firm: Firm,
        bound_enabled: Array,
        stopped: Array,
    ) -> tuple[Array, Array]:
        """(H, g) of the QP that is solved.

        Args:
            H: of the linear model. J: task rows of the first level. weight: of each, fading included.
            equal: rows of the equalities, of unit length in v / dof scales. firm: see :meth:`firm`.
            stopped: 1 for joints that bounds stop.
        """
        counts = weight != 0.0
        error = np.where(counts, error, 0.0)
        self.curvature = None
        gain = p[self._gain_at]
        largest = float(gain[counts].max(initial=0.0))
        plain = -(J.T @ (weight * desired))
        slope = J.T @ (weight * error)
        if not (np.abs(error) < TOO_FAR).all():
            return H, plain
        free = np.minimum(self._free(q, slope, bound_enabled), 1.0 - stopped)
        metric = _cut_off(self._strengthened(H, equal), free)
        if not _is_definite(metric):
            return H, plain
        curved = self._curved(H, metric, J, weight, error, slope, free, firm, equal)
        if curved is not None:
            H, metric = curved, self._strengthened(curved, equal)
            if not _is_definite(metric):
                return H, plain
            # what is definite by little only makes a step that is too long for what is held
            if (
                self._amended
                and (firm[1] >= self._tasks).any()
                and (more := self._held_short(np.asarray(np.linalg.solve(metric, free * slope)), free * slope))
            ):
                H = H + np.diag(more / self._dofs**2)
                metric = self._strengthened(H, equal)
        allowed = largest
        if self._calm:
            allowed = self._stoppable(metric, J, weight * gain**2 * error, largest, free, bound_enabled)
        if curved is None and allowed >= largest:
            return H, plain
        drift = -desired - gain * error
        wanted = np.minimum(gain, allowed) * error
        if curved is None:
            return H, J.T @ (weight * (wanted + drift))
        g = J.T @ (weight * wanted)
        if drift[counts].any():
            g -= H @ self._following(metric, J, weight, -(J.T @ (weight * drift)))
        return H, g

    def firm(self, A: Array, equal: NDArray[np.bool_], factor: Array) -> Firm:
        """Rows that keep directions, or bend, of unit length in v / dof scales; where their forces go, and how much.

        Args:
            A: general rows. equal: which are equalities. factor: fading of the task rows.
        """
        length = np.sqrt(np.einsum("ij,ij->i", A * self._dofs, A * self._dofs))
        on = np.flatnonzero(((self._kept >= 0) | self._bent) & equal & (length**2 > DEAD))
        kept = self._kept[on]
        place = np.where(kept >= 0, kept, self._tasks + on)
        return A[on] / length[on, None], place, np.where(kept >= 0, factor[kept], 1.0) / length[on]

    def _free(self, q: Array, slope: Array, bound_enabled: Array) -> Array:
        """1 for joints that may move, 0 for those that their tasks push against a position limit."""
        on = self._stop_at >= 0
        on[on] = bound_enabled[self._stop_at[on]] != 0.0
        steep = np.abs(slope) * self._dofs
        here = q[self._stop_q]
        with np.errstate(invalid="ignore"):
            room = np.where(slope < 0.0, self._stop_high - here, here - self._stop_low)
        near = np.clip(2.0 - room / (AT_LIMIT * self._dofs), 0.0, 1.0)
        pushed = np.clip(steep / (PUSHED * steep.max(initial=0.0) + np.finfo(float).tiny), 0.0, 1.0)
        return np.where(on, 1.0 - near * pushed, 1.0)

    def _curved(
        self,
        H: Array,
        metric: Array,
        J: Array,
        weight: Array,
        error: Array,
        slope: Array,
        free: Array,
        firm: Firm,
        equal: Array,
    ) -> Array | None:
        """H with the curvature of the errors that one step leaves, None where there is none to count."""
        if self._curve is None:
            return None
        pivots = np.linalg.cholesky(metric).diagonal() * self._dofs
        least = float((pivots**2).min())
        kept = bool((self._kept >= 0).any())
        none = firm[0][:0], firm[1][:0], firm[2][:0]
        force = self._left_over(H, metric, J, weight, error, slope, free, firm if kept else none, equal)
        # Errors that are left push against rows that bend: with how much is seen where these are firm
        if not kept and len(firm[0]) and self._counted(weight * error, force, least) > 0.0:
            force = self._left_over(H, metric, J, weight, error, slope, free, firm, equal)
        share = self._counted(weight * error, force, least)
        if not share > 0.0:
            return None
        curvature = share * (free[:, None] * free) * self._curve(force)
        if not np.isfinite(curvature).all():
            return None
        self.curvature = curvature
        mixed = share * _cut_off(H, free) + (1.0 - share) * H + curvature
        scale = self._dofs[:, None] * self._dofs
        least = max(LEAST_PIVOT * float(np.abs(curvature * scale).max()), least)
        more_pivot = definite(mixed * scale, least)
        self._amended = bool((more_pivot > 0.0).any())
        return np.asarray(mixed + np.diag(more_pivot / self._dofs**2))

    def _counted(self, whole: Array, force: Array, least: float) -> float:
        """Share in [0, 1] of the curvature that counts, by the errors that are left and the least pivot of H."""
        left = len(self._force_scale)
        size, all_of_it = (float((np.abs(x[:left]) * self._force_scale).sum()) for x in (force, whole))
        share = float(np.clip(size / (NEGLIGIBLE * least) - 1.0, 0.0, 1.0))
        return share * float(np.clip(size / (REMOVED * all_of_it + np.finfo(float).tiny) - 1.0, 0.0, 1.0))

    def _left_over(
        self,
        H: Array,
        metric: Array,
        J: Array,
        weight: Array,
        error: Array,
        slope: Array,
        free: Array,
        firm: Firm,
        equal: Array,
    ) -> Array:
        """Weighted errors that one step leaves, then what each general row that bends holds against them."""
        # what blocked joints are asked for is not asked of the others
        slope = free * slope
        rows, place, parts = firm
        stiffness = FIRM * float((H.diagonal() * self._dofs**2).max(initial=0.0))
        stiff = metric + _cut_off((stiffness - stiffness / FIRM) * rows.T @ rows, free)
        squares = [
            (J, weight),
            (equal, np.full(len(equal), stiffness / FIRM)),
            (rows, np.full(len(rows), stiffness - stiffness / FIRM)),
        ]
        step = self._sharp(stiff, squares, free, 0.0, slope)
        if more := self._held_short(step, slope):
            step = self._sharp(stiff + np.diag(more / self._dofs**2), squares, free, more, slope)
        step = free * step
        force = np.zeros(self._tasks + len(self._bent))
        force[: len(error)] = weight * (error - J @ step)
        force[place] -= parts * stiffness * (rows @ step)
        return force

    def _held_short(self, step: Array, slope: Array) -> float:
        """What on the diagonal, in units of the dof scales, keeps a step down a slope to about TRUSTED; or 0."""
        length = float(np.abs(step / self._dofs)[: self._dof_count].max())
        return float(np.abs(slope * self._dofs).max()) / TRUSTED * (1.0 - TRUSTED / length) if length > TRUSTED else 0.0

    def _sharp(self, metric: Array, squares: list[tuple[Array, Array]], free: Array, more: float, b: Array) -> Array:
        """metric^-1 b at rounding level, see ``sharpen`` in ``native/reach.h``.

        Args:
            squares: rows and what each counts, whose sum is the metric but for damping, ``more`` and what is cut off.
        """
        x = np.linalg.solve(metric, b)
        pivots = (np.linalg.cholesky(metric).diagonal() * self._dofs) ** 2
        if pivots.max() <= APART * pivots.min():
            return np.asarray(x)
        diagonal = (self._damping + more / self._dofs**2).astype(np.longdouble)
        for _ in range(SHARPENED):
            rest = b - diagonal * x
            for rows, counts in squares:
                wide = rows.astype(np.longdouble)
                rest = rest - free * (wide.T @ (counts * (wide @ (free * x))))
                rest = rest - (1.0 - free**2) * np.einsum("ij,ij,i->j", wide, wide, counts) * x
            change = np.linalg.solve(metric, rest.astype(np.float64))
            x = x + change
            if np.abs(change / self._dofs).max() <= 0.5 * np.finfo(np.float64).eps * np.abs(x / self._dofs).max():
                break
        return np.asarray(x)

    def _stoppable(
        self, metric: Array, J: Array, wanted: Array, largest: float, free: Array, bound_enabled: Array
    ) -> float:
        """The gain up to which all joints can brake on the way."""
        limited = self._limited(bound_enabled)
        if not limited.any():
            return largest
        rate = (free * np.abs(np.linalg.solve(metric, free * (J.T @ wanted))))[limited]
        worst = float((rate / (BRAKING * self._brake_limit[limited])).max())
        return largest / float(np.sqrt(worst)) if worst > 1.0 else largest

    def _strengthened(self, H: Array, equal: Array) -> Array:
        """H with the equality rows in it, see ``native/factor.h``."""
        stiffness = float((H.diagonal() * self._dofs**2).max(initial=0.0))
        return np.asarray(H + stiffness * equal.T @ equal)

    def _limited(self, bound_enabled: Array) -> NDArray[np.bool_]:
        """Which degrees of freedom have a limit of their acceleration now."""
        limited = self._brake_at >= 0
        limited[limited] = bound_enabled[self._brake_at[limited]] != 0.0
        return limited

    def brake_for_margins(self, A: Array, low: Array, margin: Array, p: Array, dt: float, bound_enabled: Array) -> None:
        """Raise the lower bounds of margin rows to what the joints can brake for, see ``native/margins.h``."""
        limited = self._limited(bound_enabled)
        if not limited.any() or not len(self._margin_rows):
            return
        limited = limited[: self._dof_count]
        limit = np.where(limited, BRAKING_MARGIN * self._brake_limit[: self._dof_count], np.inf)
        rows = np.abs(A[self._margin_rows, : self._dof_count])
        a = np.where(rows != 0.0, rows, 0.0) @ np.where(limited, limit, 0.0)
        free = (rows[:, ~limited] != 0.0).any(axis=1)
        h = margin[self._margin_at]
        plain = p[self._rate_at] * h
        closing = low[self._margin_rows] + plain
        with np.errstate(invalid="ignore", divide="ignore"):
            lag = dt + np.maximum(closing, 0.0) / a
            speed = 2.0 * h / (lag + np.sqrt(lag * lag + 2.0 * h / a))
            counts = (plain > 0.0) & (a > 0.0) & ~free
        raised = (np.minimum(closing, 0.0) - speed)[counts]
        low[self._margin_rows[counts]] = np.maximum(low[self._margin_rows[counts]], raised)

    def _following(self, metric: Array, J: Array, weight: Array, wanted: Array) -> Array:
        """The step that follows moving targets, corrected until only what no linear model resolves is damped."""
        x = np.linalg.solve(metric, wanted)
        for _ in range(CORRECTIONS):
            x = x + np.linalg.solve(metric, wanted - J.T @ (weight * (J @ x)) - self._damping * x)
        return np.asarray(x)


def definite(matrix: Array, least: float) -> Array:
    """The diagonal that makes a symmetric matrix positive definite, none where its pivots are above ``least``.

    The modified Cholesky factorisation of Gill and Murray (Practical Optimization, 1981, section 4.4.2.2), without
    pivoting.
    """
    a, n = matrix.copy(), len(matrix)
    more = np.zeros(n)
    sizes = np.abs(a)
    largest = float(sizes.diagonal().max())
    np.fill_diagonal(sizes, 0.0)
    other = float(sizes.max())
    bound = max(largest, other / np.sqrt(max(n * n - 1.0, 1.0)))
    for k in range(n):
        row = a[k, k + 1 :].copy()
        aside = float(np.abs(row).max(initial=0.0))
        pivot = max(abs(a[k, k]), aside * aside / bound, least)
        more[k] = pivot - a[k, k]
        a[k + 1 :, k + 1 :] -= row[:, None] * row / pivot
    return more


def _cut_off(H: Array, free: Array) -> Array:
    """H with blocked joints cut off from the others."""
    shares = free[:, None] * free
    np.fill_diagonal(shares, 1.0)
    return np.asarray(shares * H)


def _is_definite(matrix: Array) -> bool:
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
