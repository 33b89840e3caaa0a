"""What a controller does when rows conflict, and when an answer cannot be certified."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from wbc import validation
from wbc.errors import DuplicateNameError, ShapeError
from wbc.quick_dataclasses import dataclass
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout
from wbc.stack.memory import Memory
from wbc.tick.buffers import (
    BRAKED,
    CHAIN,
    CHAIN_BRAKED,
    ESCAPED,
    POLICY_BRAKED,
    RECOVERED,
    RELAXED,
    SOLVED,
    UNSOUND,
)
from wbc.tick.native import CompiledTick
from wbc.validation import Array

if TYPE_CHECKING:
    from wbc.tick.solved import SolvedTick

#: What to do with rows that cannot all hold
CONFLICTS = ("elastic", "brake")
#: Links that keep within ten periods of 2 ms on a humanoid, see docs/controller.md
QUICK = ("cold", "daqp")


@dataclass(frozen=True)
class Policy:
    """What happens where a tick has no certified optimum. Whatever it says, actuator limits hold and nothing is NaN.

    Attributes:
        conflict: where rows cannot all hold, ``elastic``: they give way in the order of sacrifice (status ``relaxed``);
            ``brake``: every joint comes to rest as fast as its bounds allow (``braked``).
        chain: what is tried, in this order, where the certificate of an answer fails or the solver has none:
            ``cold``: the same solver from an empty active set; ``daqp``, ``osqp``: these with prepared equalities;
            ``elastic``: rows get slack at a high price instead of an order of sacrifice. The first certified answer is
            taken (``recovered``, :attr:`wbc.Step.answered_by`); if none is, the tick brakes. Each link costs some
            hundred microseconds to milliseconds, on a humanoid to hundreds of milliseconds; the default leaves out
            those that would take more than ten periods of 2 ms there. An empty chain brakes at once.

    Raises:
        UnknownNameError, DuplicateNameError, ShapeError: another word, a link twice, no sequence of names.
    """

    conflict: str = "elastic"
    chain: tuple[str, ...] = QUICK
    escape: bool = False

    def __post_init__(self) -> None:
        validation.one_of("Policy.conflict", self.conflict, CONFLICTS)
        object.__setattr__(self, "escape", validation.flag("Policy.escape", self.escape))
        given: object = self.chain
        if not isinstance(given, (tuple, list)):
            raise ShapeError("Policy.chain", self.chain, "expected a sequence of names")
        for link in self.chain:
            validation.one_of("Policy.chain", link, CHAIN)
        if len(set(self.chain)) != len(self.chain):
            raise DuplicateNameError("Policy.chain", self.chain, "a link is named twice")
        object.__setattr__(self, "chain", tuple(self.chain))


class Fallback:
    """The links of one controller. :meth:`prepare` makes them, else the first tick that needs one.

    Attributes:
        prepared: no tick has to import or to make anything. flag: where the flag is in a report.
    """

    def __init__(
        self, tick: CompiledTick | SolvedTick, assembly: CompiledTick, stack: Declaration, layout: Layout
    ) -> None:
        self._policy, self.prepared = Policy(), False
        self._tick, self._given = tick, (assembly, stack, layout)
        memory = Memory(layout)
        self.flag, self._v = memory.flag, memory["v"]
        self._links: dict[str, SolvedTick] = {}

    @property
    def policy(self) -> Policy:
        """What to do."""
        return self._policy

    @policy.setter
    def policy(self, policy: Policy) -> None:
        self._policy = policy
        if self.prepared:
            self.prepare()

    def prepare(self) -> None:
        """Import and make what the policy may need: importing takes longer than a tick may."""
        for name in ("daqp", *self._policy.chain):
            if name != "cold":
                self._link(name)
        self.prepared = True

    def finish(self, flag: int) -> int:
        """Replace the report of a tick that ended with ``flag`` where the policy wants that; negative: refused."""
        if flag < 0:
            return flag
        answered = flag & ~UNSOUND
        if flag & UNSOUND:
            answered = self._chain()
        if answered == RELAXED and self._policy.conflict == "brake":
            answered = self._brake(POLICY_BRAKED)
        return 0

    def _chain(self) -> int:
        """The first link with a certified answer, else braking. RELAXED where that answer is one."""
        for link in self._policy.chain:
            self._again()
            if link == "cold":
                self._tick.reset()
                flag = self._tick.step()
            else:
                solver = self._link(link)
                flag = solver.finish(solver.qp())
            if not flag & UNSOUND and flag >= 0:
                self._tick.reset()
                if flag == BRAKED:
                    return flag  # it is proven that there is no answer
                self._tick.report[self.flag] = RECOVERED + CHAIN.index(link)
                return flag
        return self._brake(CHAIN_BRAKED)

    def _again(self) -> None:
        """Count accelerations from where the tick did."""
        self._given[0].rewind()

    def _brake(self, flag: int) -> int:
        self._again()
        self._tick.reset()
        solver = self._link("daqp")
        solver.brake(solver.qp())
        self._tick.report[self.flag] = flag
        return flag

    def lead(self, way: Array, speed: float) -> bool:
        """Command the tick again, along ``way`` (radians and characteristic lengths, of length 1) at ``speed``;
        whether that has a certified answer. Otherwise the report is that of the tick.
        """
        before = self._tick.report.copy()
        self._again()
        solver, dofs = self._link("daqp"), self._given[2].dof_scales(self._given[1])
        qp = solver.qp()
        ahead = np.zeros(qp.n)
        ahead[: len(way)] = way / dofs[: len(way)]
        firm = float((np.diag(qp.H) * dofs**2).max())
        solved = solver.finish(replace(qp, H=qp.H + firm * np.outer(ahead, ahead), g=qp.g - firm * speed * ahead))
        self._tick.reset()
        if solved == SOLVED:
            self._tick.report[self.flag] = ESCAPED
            return True
        self._tick.report[:] = before
        self._tick.v_last[:] = before[self._v]
        return False

    def _link(self, name: str) -> SolvedTick:
        if name not in self._links:
            assembly, stack, layout = self._given
            if name == "elastic":
                from wbc.tick.elastic import ElasticTick

                self._links[name] = ElasticTick(assembly, stack, layout)
            else:
                from wbc.tick.solved import SolvedTick

                self._links[name] = SolvedTick(assembly, stack, layout, name)
        return self._links[name]
