"""The drive that compares classical resolvers with pairs, shortened."""

from __future__ import annotations

from bench.measured.resolvers import drive, methods


def test_methods_follow_the_tip_and_pairs_come_back() -> None:
    made = methods()
    found = {name: drive(name, make, 2.0) for name, make in made.items() if "pairs" not in name}
    assert len(found) == len(made) - 1
    assert not any(outcome.failed for outcome in found.values())
    for name in ("pseudo-inverse", "extended Jacobian, alpha", "rank reduction, joint 1", "virtual arms, alpha exact"):
        assert found[name].lost < 1e-9
    assert found["damped, 0.01"].lost > 1e-6
    assert found["rank reduction, joint 1"].away < 1e-4
