"""What the published driver of FSP left to do: polygons, arcs, poses to begin at, criteria, switches, long courses."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.repeats import repeats
from wbc.errors import RangeError, UnknownNameError, WbcError
from wbc.published.ikor import (
    Driver,
    Method,
    Settings,
    Stop,
    Switch,
    airarm,
    arc_from,
    files as ikor_files,
    hermies,
    line_to,
    machine_of,
    planar,
    posed,
    straight,
)
from wbc.published.ikor.lines import INCREMENTS, rotation_of
from wbc.published.ikor.polygons import convex_parts, from_polygon
from wbc.published.ikor.settings import AXES, CRITERIA, DT, step_criterion

FLAT = ("x", "y")


def area(corners: np.ndarray) -> float:
    x, y = corners.T
    return float(0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def star(rng: np.random.Generator) -> np.ndarray:
    """A polygon of 3 to 9 corners round a point, convex or not, to the left or right around."""
    count = int(rng.integers(3, 10))
    angles = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.4, 0.4, count)) / count
    radii = rng.uniform(0.2, 1.0, count)
    corners = np.stack((radii * np.cos(angles), radii * np.sin(angles)), axis=1) + rng.normal(size=2)
    return corners[:: int(rng.choice([-1, 1]))]


def test_parts_of_a_polygon_are_convex_and_all_of_it() -> None:
    rng, divided = np.random.default_rng(0), 0
    for _ in range(repeats(100)):
        corners = star(rng)
        # A corner in the middle of an edge changes nothing
        parts = convex_parts(np.insert(corners, 1, 0.5 * (corners[0] + corners[1]), axis=0))
        divided += len(parts) > 1
        assert sum(map(area, parts)) == pytest.approx(abs(area(corners)), rel=1e-9)
        for part in parts:
            edges = np.roll(part, -1, axis=0) - part
            after = np.roll(edges, -1, axis=0)
            assert (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] > 0.0).all()
    assert divided > 10


def test_the_gap_of_a_line_and_a_polygon() -> None:
    """Against points of both; where they overlap, moved by it along the normal they touch."""
    rng, kinds = np.random.default_rng(1), [0, 0]
    for _ in range(repeats(60)):
        part, ends = convex_parts(star(rng))[0], rng.normal(size=(2, 2))
        normal, sizes, points = from_polygon(ends, part)
        shares = np.linspace(0.0, 1.0, 300)[:, None]
        line = ends[0] + shares * (ends[1] - ends[0])
        rim = np.concatenate([a + shares * (b - a) for a, b in zip(part, np.roll(part, -1, axis=0), strict=True)])
        apart = np.linalg.norm(line[:, None] - rim, axis=2).min()
        size = sizes.min()
        kinds[int(size > 0.0)] += 1
        assert np.linalg.norm(normal) == pytest.approx(1.0)
        if size > 0.0:
            assert -1e-9 < apart - size < 0.02
            np.testing.assert_array_equal(points, ends)
            assert (ends @ normal - (part @ normal).max() >= sizes - 1e-9).all()
        else:
            away = from_polygon(ends + (1e-9 - size) * normal, part)
            assert 0.0 < away[1].min() < 1e-6
    assert min(kinds) > 8


@pytest.mark.parametrize(
    "corners",
    [
        [[0, 0], [1, 0]],
        [[0, 0], [1, 0], [2, 0]],
        [[0, 0], [1, 1], [1, 0], [0, 1]],
        [[0, 0], [2, 0], [2, 1], [1, 0], [0, 1]],
        [[math.cos(0.8 * math.pi * k), math.sin(0.8 * math.pi * k)] for k in range(5)],
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]],
        [0, 1, 2],
    ],
)
def test_polygons_that_are_none(corners: Any) -> None:
    with pytest.raises(WbcError, match="polygon"):
        convex_parts(corners)


def test_a_planar_arm_keeps_clear_of_polygons() -> None:
    """Concave ones too. Where the tool's own way is free and the arm can bend, the margin is kept but for a tenth."""
    machine, kept = planar(), 0
    path = arc_from(machine, (0, 0), math.radians(60.0))
    free = Driver(machine, Settings(rows=FLAT)).run(path)
    points = np.array([machine.points(q) for q in free.q])
    ahead = Settings(Method.OBSTACLES, FLAT, ahead=True, generator="orthogonal", margin=0.005)
    for seed in (17, 22, 91, 145, 192):
        rng = np.random.default_rng(seed)
        k, link = int(rng.integers(20, len(free.q))), int(rng.integers(1, 4))
        middle = points[k, link] + rng.random() * (points[k, link + 1] - points[k, link])
        centre, count = middle[:2] + rng.normal(size=2) * 0.1, int(rng.integers(3, 8))
        angles = np.arange(count) * 2.0 * np.pi / count + rng.uniform(0, 6)
        radii = rng.uniform(0.04, 0.12) * np.where(np.arange(count) % 2, rng.uniform(0.5, 1), 1)
        shape = [np.stack((radii * np.cos(angles), radii * np.sin(angles)), axis=1) + centre]
        through = Driver(machine, Settings(rows=FLAT), (), shape).run(path).clearance.min()
        found = Driver(machine, ahead, (), shape).run(path)
        assert (through < -0.002, found.stop) == (True, Stop.DONE)
        kept += found.clearance.min() > 0.004
        assert any(name.split(", ")[1].startswith("polygon 1") for names in found.acted for name in names)
    assert kept == 5


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda shape: Driver(hermies(), Settings(), (), shape), "planar"),
        (lambda shape: Driver(planar(), Settings(resolver="stack"), (), shape), "FSP alone"),
        (lambda shape: Driver(planar(), Settings(Method.PSEUDO_INVERSE), (), shape), "FSP alone"),
    ],
)
def test_polygons_are_refused_where_nothing_keeps_clear_of_them(call: Any, word: str) -> None:
    with pytest.raises(RangeError, match=word):
        call([[[0, 0], [1, 0], [0, 1]]])


@pytest.mark.parametrize("machine", [planar(), hermies("holonomic"), airarm()])
def test_arcs(machine: Any) -> None:
    place, _ = machine.place(machine.home)
    centre, angle = place[:2] + [0.1, -0.05], math.radians(75.0)
    path = arc_from(machine, centre, angle, math.radians(20.0))
    off = np.vstack((place, path.points))[:, :2] - centre
    np.testing.assert_allclose(np.hypot(*off.T), math.hypot(0.1, 0.05), atol=1e-12)
    np.testing.assert_allclose(np.diff(np.unwrap(np.arctan2(*off.T[::-1]))).sum(), angle, atol=1e-12)
    assert np.linalg.norm(np.diff(path.points, axis=0), axis=1).max() <= INCREMENTS[0] + 1e-12
    assert path.euler is not None
    assert path.euler[-1, 0] - path.euler[0, 0] == pytest.approx(math.radians(20.0) * (1 - 1 / len(path.points)))
    assert Driver(machine).run(path).errors[-1] < 1e-3
    with pytest.raises(RangeError, match="centre"):
        arc_from(machine, place[:2], 1.0)


@pytest.mark.parametrize("machine", [hermies(), hermies("holonomic"), planar()])
def test_a_line_between_any_two_poses(machine: Any) -> None:
    """Poses of random configurations, of which only the pose is told."""
    rng = np.random.default_rng(2)
    for _ in range(repeats(6)):
        ends = []
        for _ in range(2):
            place, rotation = machine.place(rng.uniform(-1.2, 1.2, machine.joints))
            ends.append((place, pin.rpy.matrixToRpy(rotation)[::-1]))
        start = posed(machine, *ends[0])
        place, rotation = machine.place(start)
        np.testing.assert_allclose(place, ends[0][0], atol=1e-9)
        np.testing.assert_allclose(rotation, rotation_of(ends[0][1]), atol=1e-9)
        assert (start >= machine.lower).all()
        assert (start <= machine.upper).all()
        path = line_to(machine, *ends[1], start)
        assert path.euler is not None
        np.testing.assert_allclose(path.points[-1], ends[1][0], atol=1e-12)
        np.testing.assert_allclose(rotation_of(path.euler[-1]), rotation_of(ends[1][1]), atol=1e-9)
        np.testing.assert_allclose(machine.place(posed(machine, ends[0][0]))[0], ends[0][0], atol=1e-9)
    with pytest.raises(RangeError, match="no configuration"):
        posed(machine, (9.0, 0.0, 0.0) if machine.base == "none" else (0.0, 0.0, 9.0))


@pytest.mark.parametrize(
    "settings",
    [Settings(), Settings(criterion="acceleration", generator="orthogonal"), Settings(Method.PSEUDO_INVERSE)],
)
def test_a_platform_at_rest_is_none(settings: Settings) -> None:
    """Columns 8 to 10 left out on the way are the arm alone from there on; back in motion, they move again."""
    whole, arm, step = hermies("holonomic"), hermies(), (0.001, -0.003, -0.004)
    parts = {name: getattr(settings, name) for name in settings.__dataclass_fields__}
    switches = Switch(30, platform=False), Switch(60, platform=True)
    found = Driver(whole, Settings(**(parts | {"switches": switches}))).run(straight(whole, step, 80))
    moved = np.abs(np.diff(found.q[:, 7:], axis=0)).max(axis=1)
    assert (moved[:29] > 0.0).all()
    assert not moved[29:59].any()
    assert (moved[59:] > 0.0).all()
    # The arm alone, carried to where the platform stands
    stands = found.q[29, 7:]
    c, s = math.cos(stands[2]), math.sin(stands[2])
    base = np.array([stands[0] - 0.61 * c, stands[1] - 0.61 * s, 0.3])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    driver, path = Driver(arm, settings), straight(whole, step, 80)
    q = found.q[29, :7]
    for k in range(29, 59):
        driver.last = found.q[k, :7] - found.q[k - 1, :7]
        q = q + driver.step(q, turn.T @ (path.points[k] - base), np.zeros(3))[0]
        np.testing.assert_allclose(q, found.q[k + 1, :7], atol=1e-12)


def test_orientation_switched_on_and_off() -> None:
    machine = hermies("holonomic")
    path = straight(machine, (0.0008, -0.001, -0.001), 60, turn=(0.0, 0.004, 0.0))
    switches = Switch(40, orientation=False), Switch(20, orientation=True)
    driver = Driver(machine, Settings(switches=switches))
    found = driver.run(path)
    assert path.euler is not None

    def off(k: int) -> float:
        wanted = rotation_of(path.euler[k - 1])
        return float(np.linalg.norm(pin.log3(wanted @ machine.place(found.q[k])[1].T)))

    assert (off(19) > 0.02, off(39) < 1e-4, off(60) > 0.02) == (True, True, True)
    assert found.errors[[18, 38, 59]].max() < 1e-4


@pytest.mark.parametrize(
    "call",
    [
        lambda: Driver(hermies(), Settings(switches=(Switch(2, platform=False),))),
        lambda: Driver(hermies(), Settings(resolver="stack", switches=(Switch(2, orientation=True),))),
        lambda: Driver(hermies(), Settings(switches=(Switch(2, orientation=True),))).operate(None),
        lambda: Switch(0),
    ],
)
def test_switches_that_are_refused(call: Any) -> None:
    with pytest.raises(RangeError, match="switch"):
        call()


@pytest.mark.parametrize("name", CRITERIA)
def test_criteria_by_name(name: str) -> None:
    """On the way of a real arm each step is the one of all that do it with the least of what is asked."""
    robot = wbc.robots.load("panda", shapes="none")
    machine, rng = machine_of(robot, robot.frames["tip"]), np.random.default_rng(3)
    model, data = robot.model, robot.model.createData()
    found = Driver(machine, Settings(criterion=name, generator="orthogonal")).run(
        straight(machine, (0.002, 0.001, -0.002), 6)
    )

    def value(q: np.ndarray, last: np.ndarray, v: np.ndarray) -> float:
        torque = pin.rnea(model, data, q, last / DT, (v - last) / DT**2)
        energy = pin.computeKineticEnergy(model, data, q, v / DT)
        acceleration = float((v - last) @ (v - last))
        all_of = {"norm": v @ v, "acceleration": acceleration, "energy": energy, "torque": torque @ torque}
        return float((all_of | {"power": v / DT @ torque})[name])

    for k in range(6):
        last = found.q[k] - found.q[k - 1] if k else np.zeros(machine.joints)
        q, v = found.q[k], found.q[k + 1] - found.q[k]
        left = np.linalg.svd(machine.jacobian(q)[:3])[2][3:]
        for _ in range(20):
            other = v + 1e-4 * rng.normal(size=len(left)) @ left
            assert value(q, last, v) < value(q, last, other)


def test_weights_and_criteria_that_cannot_be() -> None:
    machine = hermies()
    with pytest.raises(RangeError, match="moves no mass"):
        Driver(machine, Settings(criterion="energy"))
    with pytest.raises(UnknownNameError, match="torque"):
        Settings(criterion="torqe")
    with pytest.raises(RangeError, match="only FSP"):
        Settings(Method.PSEUDO_INVERSE, criterion="acceleration")
    assert step_criterion(machine, "norm", machine.home, 0.0 * machine.home).weight is None


def test_a_course_of_any_length(tmp_path: Path) -> None:
    machine = planar()
    path = arc_from(machine, (0, 0), math.radians(30.0))
    points = np.repeat(path.points, 60, axis=0)[:1500]
    file = tmp_path / "TrajectoryPts"
    rows = [np.degrees(path.start), [len(points)], *points]
    file.write_text("\n".join(" ".join(f"{x:.9g}" for x in row) for row in rows))
    assert [len(ikor_files.read_trajectory(file, machine, None, most).points) for most in (1000, 1400, 9999)] == [
        1000, 1400, 1500,
    ]  # fmt: skip
    assert ikor_files.read_trajectory(file, machine).dropped == 500


def test_polygons_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "polygon_data"
    file.write_text("0 0 1 0 0 1  # a triangle\n\n0 0 2 0 2 1 1 0.5 0 1\n")
    found = ikor_files.read_polygons(file)
    assert [len(corners) for corners in found] == [3, 5]
    ikor_files.write_polygons(file, found)
    for one, other in zip(found, ikor_files.read_polygons(file), strict=True):
        np.testing.assert_array_equal(one, other)
    for bad in ("0 0 1 0", "0 0 1 0 1", "0 0 1 x 0 1", "0 0 1 1 1 0 0 1"):
        file.write_text(f"0 0 1 0 0 1\n{bad}\n")
        with pytest.raises(ikor_files.IkorFileError, match="polygon_data:2"):
            ikor_files.read_polygons(file)


def test_all_rows_with_a_switch_and_axes() -> None:
    """Rows of a phase are in the order of the axes, whatever was there before."""
    settings = Settings(
        rows=("yaw", "x", "y", "z"), switches=(Switch(3, orientation=True), Switch(5, orientation=False))
    )
    phases = Driver(hermies(), settings)._phases
    assert [driver.settings.rows for _, driver in phases] == [("x", "y", "z", "yaw"), AXES, AXES[:3]]
