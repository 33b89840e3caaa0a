"""What a controller does when rows conflict, and when an answer cannot be certified."""

from __future__ import annotations

from dataclasses import dataclass

from wbc import validation
from wbc.errors import DuplicateNameError, ShapeError

#: What to do with rows that cannot all hold
CONFLICTS = ("elastic", "brake")
#: Ways to another answer, in the order in which they are tried by default; braking is always the last
CHAIN = ("cold", "daqp", "osqp", "elastic")


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
            hundred microseconds to milliseconds; an empty chain brakes at once.

    Raises:
        UnknownNameError, DuplicateNameError, ShapeError: another word, a link twice, no sequence of names.
    """

    conflict: str = "elastic"
    chain: tuple[str, ...] = CHAIN

    def __post_init__(self) -> None:
        validation.one_of("Policy.conflict", self.conflict, CONFLICTS)
        given: object = self.chain
        if not isinstance(given, (tuple, list)):
            raise ShapeError("Policy.chain", self.chain, "expected a sequence of names")
        for link in self.chain:
            validation.one_of("Policy.chain", link, CHAIN)
        if len(set(self.chain)) != len(self.chain):
            raise DuplicateNameError("Policy.chain", self.chain, "a link is named twice")
        object.__setattr__(self, "chain", tuple(self.chain))
