"""The online filter: streams of targets and of velocities, stops, limits that shrink; judged from its states alone."""

from __future__ import annotations

import numpy as np
import pytest

from tests.repeats import covering
from wbc import errors
from wbc.trajectory import online
from wbc.trajectory.jerk.braking import reach

DOF, DT = 7, 0.004
SYNCHRONISATIONS = ("time", "phase", "none")


def filtered(rng, **changes):
    sizes = {
        "velocity": rng.uniform(0.5, 2.0, DOF),
        "acceleration": rng.uniform(2.0, 10.0, DOF),
        "jerk": rng.uniform(20.0, 150.0, DOF),
        "lower": -1.0,
        "upper": 1.0,
    }
    return online(DOF, DT, **{**sizes, **changes})


class Judge:
    """Excess of every limit over all states that it is shown, as shares."""

    def __init__(self, motion):
        self.limits, self.before, self.worst = motion.current_limits, None, np.zeros(4)

    def look(self, state):
        limits = self.limits
        beyond = np.maximum(state.position - limits.upper, limits.lower - state.position).max()
        shares = [beyond, (np.abs(state.velocity) / limits.velocity).max() - 1.0]
        shares.append((np.abs(state.acceleration) / limits.acceleration).max() - 1.0)
        if self.before is None:
            shares.append(0.0)
        else:
            change = np.abs(state.acceleration - self.before.acceleration) / DT
            shares.append((change / limits.jerk).max() - 1.0)
            # One state follows from the other under a jerk that is bounded
            ahead = self.before.position + DT * self.before.velocity + 0.5 * DT**2 * self.before.acceleration
            assert (np.abs(state.position - ahead) <= limits.jerk * DT**3 / 6.0 + 1e-9).all()
        self.worst = np.maximum(self.worst, shares)
        self.before = state


def walk(rng, motion, k, memory):
    memory["at"] = np.clip(memory.get("at", np.zeros(DOF)) + 0.1 * rng.normal(size=DOF), -1.2, 1.2)
    motion.target(memory["at"])


def passing(rng, motion, k, memory):
    if k % 40 == 0:
        motion.target(rng.uniform(-1.2, 1.2, DOF), rng.uniform(-1.0, 1.0, DOF) * motion.current_limits.velocity)


def driving(rng, motion, k, memory):
    if k % 50 == 0:
        motion.target_velocity(rng.uniform(-1.0, 1.0, DOF) * motion.current_limits.velocity)


def mixed(rng, motion, k, memory):
    if k % 23 == 0:
        [
            lambda: motion.target(rng.uniform(-1.0, 1.0, DOF)),
            lambda: motion.target_velocity(rng.choice([-1.0, 0.0, 1.0], DOF) * motion.current_limits.velocity),
            motion.stop,
        ][rng.integers(3)]()


@pytest.mark.parametrize(("course", "synchronisation"), covering([walk, passing, driving, mixed], SYNCHRONISATIONS))
def test_streams_keep_every_limit(course, synchronisation):
    rng = np.random.default_rng(5)
    motion, memory = filtered(rng, synchronisation=synchronisation), {}
    judge = Judge(motion)
    for k in range(1500):
        course(rng, motion, k, memory)
        judge.look(motion.step())
    assert (judge.worst <= 1e-9).all(), judge.worst


def crowded(rng, motion, k, memory):
    if k % 300 == 0:
        motion.target(rng.uniform(-0.35, 0.35, DOF), rng.uniform(-1.0, 1.0, DOF) * motion.current_limits.velocity)


@pytest.mark.parametrize("course", [walk, crowded, driving, mixed])
def test_ticks_that_are_known_to_be_clear_need_no_look(course):
    """With a look at every tick the states are the same, and no joint is held back in a tick that was not looked at."""
    rngs = np.random.default_rng(6), np.random.default_rng(6)
    motions = [filtered(rng, lower=-0.3, upper=0.3) for rng in rngs]
    eager, looked = motions[1], [0]
    look = eager._walls.clear

    def always():
        looked[0] += 1
        return min(look(), 1)

    eager._walls.clear = always
    memories, skipped, guarded = ({}, {}), 0, 0
    for k in range(1500):
        states = []
        for rng, motion, memory in zip(rngs, motions, memories, strict=True):
            course(rng, motion, k, memory)
            skipped += motion is motions[0] and motion._clear > 1
            states.append(motion.step())
        np.testing.assert_array_equal(states[0], states[1])
        assert motions[0].status == eager.status
        guarded += eager.status == "guarded"
    assert looked[0] == 1500
    assert skipped > 10
    assert guarded > 0 or course is not crowded, "no joint came near a wall"


def test_jitter_near_rest_raises_nothing():
    """Targets that move by 1e-13 to 1e-9 around the state, which ruckig refuses in a quarter of the cases."""
    rng = np.random.default_rng(2)
    motion = filtered(rng)
    judge, seen = Judge(motion), set()
    place = rng.uniform(-0.5, 0.5, DOF)
    for size in 10.0 ** np.arange(-13.0, -8.0):
        for _ in range(400):
            here = place + size * rng.normal(size=DOF)
            motion.reset(here, 10.0 * size * rng.normal(size=DOF), 100.0 * size * rng.normal(size=DOF))
            motion.target(here + size * rng.normal(size=DOF))
            judge.before = None
            judge.look(motion.step())
            seen.add(motion.status)
    assert (judge.worst <= 1e-9).all()
    assert "recovered" in seen


def test_what_is_refused_by_ruckig_still_moves_as_asked(monkeypatch):
    """Every tick by courses of our own: the target is reached, velocities are taken, and limits kept."""
    import ruckig

    rng = np.random.default_rng(8)
    motion = filtered(rng)

    class Refuses:
        def update(self, asked, answer):
            raise ruckig.RuckigError("no")

    monkeypatch.setattr(motion, "_ruckig", Refuses())
    judge = Judge(motion)
    goal = rng.uniform(-0.9, 0.9, DOF)
    motion.target(goal)
    for _ in range(1000):
        state = motion.step()
        judge.look(state)
        assert motion.status == "recovered"
    assert np.abs(state.position - goal).max() < 1e-9
    pace = np.where(goal > 0.0, -0.1, 0.1)
    motion.target_velocity(pace)
    for _ in range(300):
        state = motion.step()
        judge.look(state)
    assert np.abs(state.velocity - pace).max() < 1e-9
    assert (judge.worst <= 1e-9).all()


def test_velocity_targets_come_to_rest_at_the_walls():
    rng = np.random.default_rng(4)
    motion = filtered(rng)
    pace = motion.current_limits.velocity * rng.choice([-0.7, 0.7], DOF)
    motion.target_velocity(pace)
    fastest = np.zeros(DOF)
    for _ in range(2500):
        state = motion.step()
        fastest = np.maximum(fastest, np.abs(state.velocity))
    assert np.abs(fastest / np.abs(pace) - 1.0).max() < 1e-9
    assert np.abs(state.position - np.sign(pace)).max() < 1e-8
    assert np.abs(state.velocity).max() < 1e-8


@pytest.mark.parametrize("lower", [-1.0, None])
def test_stops_take_the_braking_distance(lower):
    rng = np.random.default_rng(6)
    motion = filtered(rng, lower=lower, upper=None if lower is None else 1.0)
    motion.target_velocity(0.8 * motion.current_limits.velocity)
    for _ in range(60):
        state = motion.step()
    limits = motion.current_limits
    ways = [
        reach(*row) for row in zip(state.velocity, state.acceleration, limits.acceleration, limits.jerk, strict=True)
    ]
    begin = state.position
    motion.stop()
    for _ in range(400):
        state = motion.step()
        done = state.position - begin
        assert (done <= [high + 1e-9 for _, high in ways]).all()
        assert (done >= [low - 1e-9 for low, _ in ways]).all()
    assert np.abs(state.velocity).max() < 1e-9
    assert motion.status == "reached"
    assert np.abs(done - [high for _, high in ways]).max() < 1e-8


def test_a_joint_on_its_way_into_a_wall_is_braked_whatever_is_asked():
    """From any state that can stop: targets beyond the wall with a speed into it."""
    rng = np.random.default_rng(11)
    guarded = 0
    for _ in range(10):
        motion = filtered(rng, synchronisation="none")
        limits = motion.current_limits
        speed = rng.uniform(0.2, 1.0, DOF) * limits.velocity
        ways = [reach(v, 0.0, a, j)[1] for v, a, j in zip(speed, limits.acceleration, limits.jerk, strict=True)]
        motion.reset(1.0 - np.array(ways) - 1e-3 * rng.uniform(size=DOF), speed)
        motion.target(np.full(DOF, 1.0), limits.velocity)
        judge = Judge(motion)
        for _ in range(300):
            judge.look(motion.step())
            guarded += motion.status == "guarded"
        assert (judge.worst <= 1e-8).all(), judge.worst
    assert guarded > 100


def test_limits_that_shrink():
    rng = np.random.default_rng(9)
    motion = filtered(rng)
    motion.target(np.full(DOF, 0.95))
    for _ in range(100):
        state = motion.step()
    before = motion.current_limits
    motion.limits(velocity=0.3 * before.velocity, lower=-0.5, upper=0.6)
    fast = np.abs(state.velocity)
    for _ in range(1500):
        state = motion.step()
        assert (np.abs(state.velocity) <= np.maximum(fast, 0.3 * before.velocity) * 1.05 + 1e-9).all()
    assert np.abs(state.position - 0.6).max() < 1e-8
    assert motion.clipped
    motion.limits(upper=1.0)
    for _ in range(1500):
        state = motion.step()
    assert np.abs(state.position - 0.95).max() < 1e-8
    assert not motion.clipped


def test_targets_with_a_velocity_are_passed_and_gone_on_from():
    motion = online(1, 0.001, velocity=1.0, acceleration=5.0, jerk=50.0)
    motion.target([0.5], [0.3])
    states = [motion.step() for _ in range(3000)]
    at = min(states, key=lambda s: abs(s.position[0] - 0.5))
    assert abs(at.velocity[0] - 0.3) < 1e-2
    assert abs(states[-1].velocity[0] - 0.3) < 1e-9
    assert states[-1].position[0] > 0.6


@pytest.mark.parametrize(
    ("call", "error", "field"),
    [
        (lambda m: m.target([0.0] * 6), errors.ShapeError, "target.position"),
        (lambda m: m.target([np.nan] * 7), errors.NotFiniteError, "target.position"),
        (lambda m: m.target([0.0] * 7, [9.0] * 7), errors.RangeError, "target.velocity"),
        (lambda m: m.target_velocity([np.inf] * 7), errors.NotFiniteError, "target_velocity"),
        (lambda m: m.target_velocity([9.0] * 7), errors.RangeError, "target_velocity"),
        (lambda m: m.limits(velocity=0.0), errors.RangeError, "limits.velocity"),
        (lambda m: m.limits(jerk=[1.0] * 3), errors.ShapeError, "limits.jerk"),
        (lambda m: m.limits(lower=2.0), errors.BoundsError, "limits.lower"),
        (lambda m: m.reset([2.0] * 7), errors.BoundsError, "position"),
        (lambda m: m.reset([0.0] * 7, [9.0] * 7), errors.RangeError, "velocity"),
    ],
)
def test_bad_input_changes_nothing(call, error, field):
    motions = [filtered(np.random.default_rng(1)) for _ in range(2)]
    for motion in motions:
        motion.target(np.full(DOF, 0.4))
        for _ in range(20):
            motion.step()
    with pytest.raises(error) as caught:
        call(motions[0])
    assert caught.value.field == field
    for _ in range(50):
        one, other = (m.step() for m in motions)
        assert np.array_equal(one.position, other.position)
        assert np.array_equal(one.acceleration, other.acceleration)


@pytest.mark.parametrize("synchronisation", SYNCHRONISATIONS)
@pytest.mark.parametrize("far", [1e3, 1e6])
def test_moves_of_hours_are_begun(far, synchronisation):
    """Longer than the 7e3 s that ruckig takes: its binding answers with a ValueError."""
    dt, limits = 0.01, {"velocity": [0.1, 0.2], "acceleration": [1.0, 0.5], "jerk": [5.0, 5.0]}
    filter = online(2, dt, **limits, synchronisation=synchronisation)
    filter.target([far, -0.5 * far])
    states = [filter.step() for _ in range(150)]
    assert {filter.status} <= {"moving", "recovered"}
    velocity, acceleration = (np.array([getattr(s, name) for s in states]) for name in ("velocity", "acceleration"))
    assert (np.abs(velocity) <= np.array(limits["velocity"]) + 1e-9).all()
    assert (np.abs(acceleration) <= np.array(limits["acceleration"]) + 1e-9).all()
    assert (np.abs(np.diff(acceleration, axis=0)) <= np.array(limits["jerk"]) * dt + 1e-9).all()
    # The joint that takes the longest goes at its highest speed
    assert velocity[-1, 0] == pytest.approx(0.1, rel=1e-6)
    assert velocity[-1, 1] < -0.02
