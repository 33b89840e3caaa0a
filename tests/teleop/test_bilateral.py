"""Bilateral teleoperation: bounds that are checked, energy that comes from nowhere else, what is felt, and robots."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from numpy.polynomial import polynomial as poly

import wbc
from tests.simulation.lagging import LaggingPlant
from tests.teleop.bilateral_runs import DT, drawn, reach
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.teleop.bilateral import (
    Bilateral,
    Channel,
    Channels,
    Device,
    Operator,
    Port,
    Scheme,
    Wall,
    four_channel,
    position_force,
    position_position,
    run_bilateral,
)
from wbc.teleop.bilateral.arms import FollowingArm
from wbc.teleop.bilateral.run import _largest
from wbc.teleop.bilateral.scheme import Side, absolute_stability

DEVICE = Device(2.0, 15.0)
SCHEMES = {"pp": position_position(), "pf": position_force(), "4c": four_channel()}
LATE = Channel(0.3)


def test_no_gains_and_no_links_make_it_unstable() -> None:
    rng, count, ticks = np.random.default_rng(21), 120, 500
    systems, hands, walls = zip(*[drawn(rng, ticks) for _ in range(count)], strict=True)
    run = run_bilateral(systems, hands, walls, seed=1)
    size = run.injected.max(axis=0) + 1e-9
    # What both sides give out they have taken in, at every tick; so all energy there is the operator has put in
    assert ((run.given - run.taken) / size).max() < 1e-12
    assert ((run.stored - run.injected) / size).max() < 1e-12
    assert np.isfinite(run.slave).all()
    # It is the passivity control that does this
    free = [dataclasses.replace(one, passivity=False, unchecked=True) for one in systems]
    with np.errstate(all="ignore"):
        wild = run_bilateral(free, hands, walls, seed=1)
        assert (~(wild.excess() < size)).sum() > count / 3


def test_a_step_gives_out_what_there_is_and_not_less_than_it_can() -> None:
    rng = np.random.default_rng(4)
    a, b = np.abs(rng.normal(size=400)), rng.normal(size=400)
    c, most = rng.normal(size=400) * (rng.random(400) < 0.8), rng.random(400)
    a[:20] = 0.0
    b[:20] = -np.abs(b[:20])
    found = _largest(a, b, c, most)
    grid = np.linspace(0.0, 1.0, 2001)[:, None] * most
    value = a * grid**2 + b * grid
    fits = value <= c + 1e-12
    best = np.where(fits.any(axis=0), (grid * fits).max(axis=0), grid[value.argmin(axis=0), np.arange(400)])
    np.testing.assert_allclose(found, best, atol=2e-3)
    kept = fits.any(axis=0)
    assert (a * found**2 + b * found <= c + 1e-9)[kept].all()


def test_six_tenths_of_a_second_of_delay() -> None:
    """With jitter and losses: each scheme follows, touches and comes to rest, and forces are felt."""
    broken, path = Channel(0.3, 0.1, 0.3), reach(seconds=8.0)
    systems = [Bilateral(scheme, DEVICE, DEVICE, broken, broken, DT) for scheme in SCHEMES.values()]
    run = run_bilateral(systems * 2, [Operator(path)] * 6, [Wall()] * 3 + [Wall(0.15)] * 3)
    assert (run.given <= run.taken + 1e-12).all()
    there = round(3.9 / DT)
    np.testing.assert_allclose(run.slave[there, :3, 0], 0.3, atol=0.03)
    assert (run.slave[there, 3:, 0] > 0.17).all()
    assert (run.slave[there, 3:, 0] < 0.2).all()
    assert (run.wall_force[there, 3:, 0] < -20.0).all()
    felt = run.operator_force[there, 3:, 0]
    assert felt[0] == pytest.approx(25.0, abs=0.5)
    assert felt[2] == pytest.approx(39.4, abs=1.0)
    assert np.abs(run.slave[-1, [0, 1, 2, 3, 5], 0]).max() < 0.03
    assert np.abs(run.slave_v[-1]).max() < 0.05
    # Of a force that is late little is felt, and the slave has no energy left to come all the way back
    assert 0.0 < felt[1] < 10.0
    assert 0.05 < run.slave[-1, 4, 0] < 0.15


def test_late_forces_without_passivity_control_are_unstable() -> None:
    light, links = Device(2.0, 6.0), (Channel(0.2), Channel(0.2))
    free = Bilateral(SCHEMES["pf"], light, light, *links, DT, passivity=False, unchecked=True)
    kept = dataclasses.replace(free, passivity=True)
    run = run_bilateral([free, kept], [Operator(reach(), 100.0)] * 2, [Wall(0.15)] * 2)
    assert run.excess()[0] > 5.0
    assert run.excess()[1] <= 0.0


def test_what_is_felt_without_delay() -> None:
    """Four channels: the wall itself; positions: the wall in series with the coupling."""
    made = [Bilateral(s, DEVICE, DEVICE, dt=DT) for s in SCHEMES.values()]
    path = np.tile(reach(seconds=4.0)[-1:] + 0.3, (1200, 1))
    run = run_bilateral(made, [Operator(path)] * 3, [Wall(0.0)] * 3)
    felt = dict(zip(SCHEMES, run.operator_force[-1, :, 0] / run.master[-1, :, 0], strict=True))
    assert felt["4c"] == pytest.approx(1000.0, rel=1e-3)
    assert felt["pp"] == pytest.approx(1.0 / (1 / 1000.0 + 1 / 400.0), rel=1e-3)
    assert felt["pf"] == pytest.approx(1.0 / (1 / 1000.0 + 1 / 400.0), rel=1e-2)
    np.testing.assert_allclose(run.operator_force[-1], -run.wall_force[-1], rtol=1e-2)
    assert run.master[-1, 2, 0] == pytest.approx(run.slave[-1, 2, 0], rel=1e-6)


def test_four_channels_move_as_one_mass() -> None:
    """Of twice a device's mass and damping with a share of a half: the first ticks under a spring."""
    system = Bilateral(SCHEMES["4c"], DEVICE, DEVICE, dt=DT, passivity=False)
    path = np.full((200, 1), 0.1)
    run = run_bilateral(system, Operator(path, 100.0, 0.0), Wall())
    x = v = 0.0
    for k in range(200):
        assert run.master[k, 0, 0] == pytest.approx(x, abs=1e-12)
        v = (4.0 * v + DT * 100.0 * (0.1 - x)) / (4.0 + DT * 30.0)
        x += DT * v
    np.testing.assert_allclose(run.master, run.slave, atol=1e-12)


def test_links() -> None:
    rng = np.random.default_rng(0)
    late = Channel(0.05).newest(40, DT, rng)
    np.testing.assert_array_equal(late, np.maximum(np.arange(40) - 9, 0))
    np.testing.assert_array_equal(Channel().newest(5, DT, rng), [1, 2, 3, 4, 5])
    broken = Channel(0.02, 0.1, 0.5).newest(4000, DT, rng)
    assert (np.diff(broken) >= 0).all()
    assert (broken <= np.arange(4000) - 3).all() or broken[0] == 0
    # Half of the packets are lost and many are overtaken, so the newest one is older than the delay
    age = np.arange(4000) + 1 - broken
    assert 4 < age[100:].mean() < 24


def characteristic(master: Device, slave: Device, scheme: Scheme, delays: tuple[int, int], ends: np.ndarray) -> float:
    """Largest |z| of the loop closed by spring-dampers ``ends`` [(k, b), (k, b)], by roots of a polynomial in 1/z."""
    w, v = np.array([0.0, 1.0]), np.array([1.0, -1.0])

    def late(n: int) -> np.ndarray:
        return np.eye(n + 1)[n]

    def line(k: float, b: float) -> np.ndarray:
        return poly.polyadd(k * DT * w, b * poly.polymul(w, v))

    rows = []
    for own, other, device, channel, n in (
        (0, 1, master, scheme.master, delays[1]),
        (1, 0, slave, scheme.slave, delays[0]),
    ):
        inertia = poly.polyadd(device.mass / DT * poly.polymul(v, v), device.damping * v)
        coupling = line(channel.stiffness, channel.damping)
        here = poly.polyadd(poly.polyadd(inertia, coupling), (1 - channel.local_force) * line(*ends[own]))
        there = poly.polysub(channel.remote_force * line(*ends[other]), coupling)
        rows.append((here, poly.polymul(late(n), there)))
    whole = poly.polysub(poly.polymul(rows[0][0], rows[1][0]), poly.polymul(rows[0][1], rows[1][1]))
    return float(np.abs(np.roots(whole)).max())


def test_what_is_accepted_without_passivity_control_is_stable() -> None:
    """With springs and dampers at both ends; and of what is refused many such ends make some unstable."""
    rng, seen = np.random.default_rng(8), {True: 0, False: 0}
    wild = 0
    for scheme, delay in itertools.product(("pp", "pf", "4c"), range(0, 36, 3)):
        stiffness, damping = 10 ** rng.uniform(1, 3), 10 ** rng.uniform(-1, 2)
        share = rng.uniform(0.05, 0.9)
        made = {
            "pp": position_position(stiffness, damping),
            "pf": position_force(stiffness, damping, share),
            "4c": four_channel(stiffness, damping, min(share, 0.5)),
        }[scheme]
        devices = [Device(2.0, rng.uniform(6, 80)) for _ in range(2)]
        links = Channel(delay * DT), Channel(delay * DT)
        try:
            Bilateral(made, *devices, *links, DT, passivity=False)
            accepted = True
        except RangeError:
            accepted = False
        seen[accepted] += 1
        largest = 0.0
        for _ in range(10):
            ends = np.column_stack((rng.uniform(0, 2000, 2), rng.uniform(0, 50, 2))) * (rng.random((2, 2)) < 0.6)
            largest = max(largest, characteristic(*devices, made, (delay, delay), ends))
        if accepted:
            assert largest < 1.0 + 1e-6
        wild += largest > 1.0 + 1e-6
    assert min(seen.values()) > 5
    assert wild > 3


def test_poles_are_counted() -> None:
    """The winding number, beside the roots of the polynomial, of teleoperators that nobody touches."""
    rng, both = np.random.default_rng(2), set()
    for _ in range(60):
        n = int(rng.integers(0, 8))
        sides = [Device(rng.uniform(0.5, 5), rng.uniform(0, 30), 0.0, 0.0) for _ in range(2)]
        scheme = Scheme(*(Channels(10 ** rng.uniform(0, 4), 10 ** rng.uniform(0, 2.5)) for _ in range(2)))
        told = absolute_stability(
            *(Side(d.mass / DT, d.damping, c.stiffness * DT, c.damping, 0.0, 0.0)
              for d, c in zip(sides, (scheme.master, scheme.slave), strict=True)), n, n, DT)  # fmt: skip
        largest = characteristic(*sides, scheme, (n, n), np.zeros((2, 2)))
        if abs(largest - 1.0) < 1e-9 or largest > 1.0 + 1e-5:
            unstable = largest > 1.0 + 1e-5
            assert told.startswith("the teleoperator is unstable by itself") == unstable
            both.add(unstable)
    assert both == {True, False}


def test_the_known_bound_on_delayed_springs_is_within_what_is_accepted() -> None:
    """4 d_m d_s > (T_1 + T_2)^2 K_m K_s suffices (Nuno, Basanez, Ortega, 2011), with what sampling adds to both."""
    rng = np.random.default_rng(5)
    for _ in range(30):
        K, n = 10 ** rng.uniform(0, 3, 2), rng.integers(0, 120, 2)
        least = 0.5 * (n.sum() * DT + 2 * DT) * math.sqrt(K[0] * K[1])
        ratio = 10 ** rng.uniform(-0.5, 0.5)
        parts = zip((ratio, 1 / ratio), K, strict=True)
        devices = [Device(2.0, 1.01 * least * part + 5.0 + k * DT / 2) for part, k in parts]
        scheme = Scheme(Channels(K[0]), Channels(K[1]))
        Bilateral(scheme, *devices, Channel(n[0] * DT), Channel(n[1] * DT), DT, passivity=False)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Bilateral(SCHEMES["pp"], Device(2.0, 4.9), DEVICE, dt=DT), r"master.damping: .*fest \* dt / 2 = 5"),
        (lambda: Bilateral(SCHEMES["pp"], DEVICE, Device(0.2, 15.0), dt=DT), r"slave.mass: .*_damped \* dt = 0.25"),
        (lambda: Bilateral(SCHEMES["pp"], DEVICE, DEVICE, LATE, LATE, DT, False), "2 poles outside the unit circle"),
        (lambda: Bilateral(position_position(100.0, 0.0), DEVICE, DEVICE, Channel(0.1), Channel(0.1), DT, False),
         r"Llewellyn's bound 2 Re Y11 Re Y22 .* is broken at 0.546 Hz"),
        (lambda: Bilateral(SCHEMES["4c"], DEVICE, DEVICE, LATE, LATE, DT, False), "or use passivity=True"),
        (lambda: Bilateral(SCHEMES["pp"], DEVICE, DEVICE, Channel(0.1, 0.1), LATE, DT, False), "only a constant delay"),
        (lambda: Scheme(Channels(), Channels(damping=3.0)), "positions drift apart"),
        (lambda: Channel(loss=1.0), "nothing would arrive"),
        (lambda: Channel(11.0), r"Channel.delay: expected a value in \[0, 10\]"),
        (lambda: Device(mass=0.0), "Device.mass"),
        (lambda: Channels(local_force=1.5), "Channels.local_force"),
        (lambda: run_bilateral(Bilateral(SCHEMES["pp"], DEVICE, DEVICE, dt=DT), Operator(reach()), Wall(0, 3e3)),
         "wall.stiffness: expected at most 2000"),
    ],
)  # fmt: skip
def test_refusals_name_the_bound(make, text: str) -> None:
    with pytest.raises(RangeError, match=text):
        make()


def test_other_bad_input() -> None:
    system = Bilateral(SCHEMES["pp"], DEVICE, DEVICE, dt=DT)
    with pytest.raises(NotFiniteError):
        Device(mass=math.nan)
    with pytest.raises(ShapeError, match="expected a Scheme"):
        Bilateral("pp")  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="as many as operators"):
        run_bilateral([system] * 2, Operator(reach()), Wall())
    with pytest.raises(ShapeError, match="one shape"):
        run_bilateral(system, Operator(reach()[:, 0]), Wall())
    with pytest.raises(NotFiniteError):
        run_bilateral(system, Operator(np.full((3, 1), np.nan)), Wall())


def test_an_interrupted_run_keeps_what_it_has() -> None:
    def progress(done: int) -> None:
        if done == 7:
            raise KeyboardInterrupt

    run = run_bilateral(Bilateral(SCHEMES["pp"], DEVICE, DEVICE, dt=DT), Operator(reach()), Wall(), progress=progress)
    assert run.interrupted
    assert len(run.time) == len(run.master) == run.taken.shape[0] == 6


def test_two_robots_by_hand() -> None:
    """A Panda leads a Space Station arm in twice its motion; both hands are where their devices are."""
    panda, station = wbc.robots.load("panda"), wbc.robots.load("ssrms")
    bent = np.radians([0.0, 30.0, -60.0, 90.0, -60.0, 20.0, 0.0])
    master = FollowingArm(panda, "panda_hand_tcp", dt=DT, backend="vm")
    slave = FollowingArm(station, "tip", dt=DT, q=bent, scale=2.0, backend="vm")
    q0 = master.q
    link = Channel(0.05, 0.02, 0.2)
    system = Bilateral(SCHEMES["4c"], DEVICE, DEVICE, link, link, DT)
    path = reach(0.05, 2.0, 3, 1)[::2]
    run = run_bilateral(system, Operator(path), Wall(0.02), arms=(master, slave))
    assert (run.given <= run.taken + 1e-9).all()
    assert 0.02 < run.slave[-1, 0, 1] < 0.05
    for robot, frame, before, after, moved in (
        (panda, "panda_hand_tcp", q0, master.q, run.master[-1, 0]),
        (station, "tip", bent, slave.q, 2.0 * run.slave[-1, 0]),
    ):
        ends = [wbc.tasks.frames.frame_pose(robot, frame, q) for q in (before, after)]
        np.testing.assert_allclose(ends[1].translation - ends[0].translation, moved, atol=2e-3)
        np.testing.assert_allclose(ends[1].rotation, ends[0].rotation, atol=1e-4)


def test_two_robots_by_joints_that_lag_and_stop_at_a_limit() -> None:
    """The slave's plant follows late and its joint 1 ends at 0.1 rad: its device is where the arm is."""
    robot = wbc.robots.load("planar_3r", position_lower=-1.0, position_upper=[0.1, 1.0, 1.0], acceleration=np.inf)
    master = FollowingArm(wbc.robots.load("planar_3r"), dt=DT, q=np.full(3, 0.5), backend="vm")
    slave = FollowingArm(robot, dt=DT, q=np.zeros(3), plant=LaggingPlant(robot, 0.02, 5, 0.0), backend="vm")
    system = Bilateral(SCHEMES["pp"], DEVICE, DEVICE, Channel(0.05), Channel(0.05), DT)
    run = run_bilateral(system, Operator(reach(0.3, 2.4, 3)[::2]), Wall(), arms=(master, slave))
    assert slave.q[0] == pytest.approx(0.1, abs=5e-3)
    np.testing.assert_allclose(slave.q, run.slave[-1, 0], atol=0.01)
    # The limit is felt
    assert run.operator_force[-1, 0, 0] > 10.0
    assert (run.stored <= run.injected + 1e-9).all()


def test_arms_that_do_not_fit() -> None:
    system = Bilateral(SCHEMES["pp"], DEVICE, DEVICE, dt=DT)
    arm = FollowingArm(wbc.robots.load("planar_3r"), dt=0.01, backend="vm")
    with pytest.raises(ShapeError, match=r"3 coordinates and 0.005 s"):
        run_bilateral(system, Operator(reach(n=3)), Wall(), arms=(arm, None))
    with pytest.raises(UnknownNameError, match="did you mean 'tip'"):
        FollowingArm(wbc.robots.load("planar_3r"), "tipp", dt=DT)
    with pytest.raises(ShapeError, match="positions are a vector"):
        FollowingArm(wbc.robots.load("anymal_b"), dt=DT)


def test_a_port_alone_serves_a_real_link() -> None:
    """Two ports that exchange packets, as two machines would."""
    left, right = (Port([DEVICE], [c], DT, [True], 1) for c in (SCHEMES["pp"].master, SCHEMES["pp"].slave))
    force, nothing = np.array([[3.0]]), np.zeros((1, 1))
    for _ in range(400):
        packets = left.packet(force), right.packet(nothing)
        goals = left.step(packets[1], force), right.step(packets[0], nothing)
        left.moved(goals[0], force)
        right.moved(goals[1], nothing)
    assert right.x[0, 0] == pytest.approx(left.x[0, 0], rel=0.1)
    assert right.x[0, 0] > 0.1
    assert left.given + right.given <= left.taken + right.taken
