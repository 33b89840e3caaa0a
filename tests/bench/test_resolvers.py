"""The drive that compares classical resolvers with pairs, shortened."""

from __future__ import annotations

from bench.measured.resolvers import drive, methods


def test_methods_follow_the_tip_and_pairs_come_back() -> None:
    made = methods()
    found = {name: drive(make, 2.0) for name, make in made.items() if "pairs" not in name}
    assert len(found) == len(made) - 1
    assert not any(isinstance(took, str) for took, *_ in found.values())
    lost, away = ({name: numbers[k] for name, numbers in found.items()} for k in (2, 3))
    for name in ("pseudo-inverse", "extended Jacobian, alpha", "rank reduction, joint 1", "virtual arms, alpha exact"):
        assert lost[name] < 1e-9
    assert lost["damped, 0.01"] > 1e-6
    assert away["rank reduction, joint 1"] < 1e-4
