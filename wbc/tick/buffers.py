"""What ticks have in common: flat buffers that the controller writes, the report that it reads, flags, tolerances."""

from __future__ import annotations

import numpy as np

from wbc.quick_dataclasses import dataclass
from wbc.validation import Array

#: Flag of a tick: every hard row holds
SOLVED = 0
#: Flag of a tick: rows that may give way do so
RELAXED = 1
#: Flag of a tick: no answer, the robot brakes
BRAKED = 2
#: Flag of a tick: the cap on iterations ended the search; v keeps the bounds
CAPPED = 3
#: In the report in place of a flag: the first of the links of a chain that may have given the answer
RECOVERED = 4
#: The same: the chain ended and the robot brakes
CHAIN_BRAKED = 8
#: The same: the robot brakes because the policy wants it
POLICY_BRAKED = 9
#: The same: moved out of a singular configuration because the policy wants it
ESCAPED = 10
#: Added to what a tick returns, not to what it reports: the certificate fails, or a solver has found no answer
UNSOUND = 4
#: A refusal, of three: nothing was changed
BAD_V = -3

#: Stand-in for infinity in bounds and in the error bound of a tick without a certificate
INFINITE = 1e30

#: Violations up to this, in row units, are rounding; as in ``native/settings.h``
TOLERANCE = 1e-9

#: A certificate fails where a violation is above this, as in ``native/settings.h``, as do those below
SOUND = 1e-6
#: A certificate fails where the bound on the error of v is above this (a characteristic length counts as 1 rad) and the
#: optimality conditions are off by more than OPTIMAL
KNOWN = 1e-3
#: See KNOWN
OPTIMAL = 1e-9
#: A certificate fails where a row that never gives way is violated by more than this
FIRMLY = 1e-8

#: What equality rows may lose [rad, or characteristic lengths, per second]; as in ``native/bend.h``, as are those below
BENDS = 1e-3
#: Loss from where on joints that bounds stop are not counted on [rad, or characteristic lengths, per second]
STRETCHED = 2e-2
#: How often rows are corrected
BENDINGS = 8
#: How often the step gets shorter
SHORTER = 3
#: Factor of the price of a step that gets shorter
STEEPER = 100.0
#: Rate from which on a joint turns round [rad/s]
TURNING = 1.0
#: What exact rows may miss 0 at q (+) v dt by [rad, or characteristic lengths]
EXACT = 1e-10
#: What they give way by from where on, likewise
OPENED = 1e-9
#: How often exact rows are corrected
REFINED = 24
#: How fast a robot whose base floats loses its velocity where a tick has no answer [1/s]; as in ``native/settings.h``
REST_RATE = 20.0

#: Paths to another answer, the quickest first, of which ``Policy`` tries some by default; braking is always the last
CHAIN = ("cold", "daqp", "osqp", "elastic")

#: Buffers that are 0 when a tick begins, and that the tick itself writes
OWN = ("bend", "curving", "stopped", "shortened", "shortfall", "pressed")


class Buffers:
    """Flat float64 arrays, written in place.

    Attributes:
        q: configuration. v_in, use_v: a measured velocity, taken where ``use_v`` is not 0.
        cap: iterations of the native solver a tick at most, 0 for no cap.
        v_last: the velocity that accelerations are counted from.
        p: run-time inputs, see :class:`wbc.stack.layout.Layout`. dt: one number.
        weight: of each task row, scale included. enabled: 1 or 0 for each general row.
        bound_enabled: the same for each entry of each bound block.
        bend: added to both sides of equality rows that bend, see ``native/bend.h``; curving: not 0 where H has their
            curvature without calm motion, too; stopped: 1 for joints that bounds stop; shortened: on
            the diagonal of H besides; shortfall, pressed: what bounds on velocities let a command leave of each
            error, and what margins hold against it, see ``native/reach.h``. All 0 when a tick begins.
        report: see :class:`wbc.stack.memory.Memory`.
        state: all of these in one piece of memory that begins with the report. ``v_in`` in it is, after a tick, the
            velocity that the tick counted accelerations from.
    """

    q: Array
    v_in: Array
    use_v: Array
    cap: Array
    v_last: Array
    p: Array
    dt: Array
    weight: Array
    enabled: Array
    bound_enabled: Array
    bend: Array
    curving: Array
    stopped: Array
    shortened: Array
    shortfall: Array
    pressed: Array
    report: Array
    state: Array
    #: of accelerations, the torques of the last command and the wrenches that a tick without an answer keeps
    #: [variables]; empty for velocities
    kept: Array = np.zeros(0)

    def share(self, other: Buffers) -> None:
        """Use the arrays of ``other``."""
        for name in Buffers.__annotations__:
            setattr(self, name, getattr(other, name))
        self.kept = other.kept


@dataclass(frozen=True, eq=False)
class TaskRows:
    """Rows of all tasks in the last QP: J [rows, nv], desired rates and fading factors [rows]."""

    J: Array
    desired: Array
    factor: Array
