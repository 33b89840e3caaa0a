"""What follows a tick whose answer is not certified, or not wanted: the chain of a :class:`Policy`."""

from __future__ import annotations

from wbc.controller.elastic import ElasticTick
from wbc.controller.native import NativeTick
from wbc.controller.policy import CHAIN, Policy
from wbc.controller.report import CHAIN_BRAKED, POLICY_BRAKED, RECOVERED, RELAXED, UNSOUND, ReportLayout
from wbc.controller.solved import SolvedTick
from wbc.controller.tick import Assembly
from wbc.qp.factor import load
from wbc.stack.declaration import Declaration
from wbc.stack.layout import Layout


class Fallback:
    """The links of one controller. :meth:`prepare` makes them, else the first tick that needs one.

    Attributes:
        prepared: no tick has to import or to make anything.
    """

    def __init__(self, tick: NativeTick | SolvedTick, assembly: Assembly, stack: Declaration, layout: Layout) -> None:
        self._policy, self.prepared = Policy(), False
        self._tick, self._given = tick, (assembly, stack, layout)
        self._flag = ReportLayout(layout).flag
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
        load()
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
                self._tick.report[self._flag] = RECOVERED + CHAIN.index(link)
                return flag
        return self._brake(CHAIN_BRAKED)

    def _again(self) -> None:
        """Count accelerations from where the tick did."""
        self._tick.v_last[:] = self._tick.v_in

    def _brake(self, flag: int) -> int:
        self._again()
        self._tick.reset()
        solver = self._link("daqp")
        solver.brake(solver.qp())
        self._tick.report[self._flag] = flag
        return flag

    def _link(self, name: str) -> SolvedTick:
        if name not in self._links:
            assembly, stack, layout = self._given
            link = ElasticTick(assembly, stack, layout) if name == "elastic" else None
            self._links[name] = link or SolvedTick(assembly, stack, layout, name)
        return self._links[name]
