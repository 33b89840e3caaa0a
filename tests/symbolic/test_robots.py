"""Every robot of example-robot-data against Pinocchio on its own base, a third of them floating, and some planar.

Norm: max |ours - Pinocchio's| / max(1, max |Pinocchio's|) of each quantity, 1e-10; one random state a case.
"""

from __future__ import annotations

import pytest

from tests.repeats import ALL, MORE
from tests.symbolic.referee import FILES, Comparison, load

PLANAR = (
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
    "kinova_description/robots/kinova.urdf",
    "tiago_description/robots/tiago_no_hand.urdf",
    "pr2_description/urdf/pr2.urdf",
    "panda_description/urdf/panda.urdf",
)
#: A base that floats is one more joint, the same on every robot: each third has it, and with ``REPEATS=3`` as well as
#: one that is fixed. Every fourth case is tried, and with ``REPEATS=3`` all
CASES = [
    *((file, "fixed") for k, file in enumerate(FILES) if k % 3 or MORE >= ALL),
    *((file, "floating") for file in FILES[::3]),
    *((file, "planar") for file in PLANAR),
][:: 1 if MORE >= ALL else 4]

#: Up to this many degrees of freedom the derivatives of inverse dynamics are compared whole, above it along one
#: random direction, which checks every entry with probability 1 at a fraction of the time.
WHOLE_DERIVATIVES = 9


def test_the_wheel_has_the_robots_that_the_table_was_made_for() -> None:
    assert len(FILES) == 68


@pytest.mark.parametrize(("file", "base"), CASES, ids=[f"{base}-{file}" for file, base in CASES])
def test_agrees_with_pinocchio(file: str, base: str) -> None:
    """Motions of frames, motions of the centre, and forces with their derivatives, each on a third of the robots, and
    with ``REPEATS=3`` all on all.
    """
    model = load(file, base)
    comparison = Comparison(model)
    comparison.poses()
    if model.nv > 0:
        turn = FILES.index(file) // 3 % 3
        if turn == 0 or MORE >= ALL:
            comparison.frame_motion()
        if turn == 1 or MORE >= ALL:
            comparison.center()
        if turn == 2 or MORE >= ALL:
            comparison.forces()
            comparison.torque_derivatives(full=model.nv <= WHOLE_DERIVATIVES)
        comparison.manifold()
    comparison.check()
