"""Support regions against polygons that are known and against the ticks, and what is lacking at rest, by name."""

from __future__ import annotations

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from tests.torque.problems import DT, controller, robot
from wbc.api import Controller, Stack
from wbc.errors import CommandError, RangeError
from wbc.support import Region, lacking, region
from wbc.tasks import CenterOfMass, Posture, SupportRegion
from wbc.tasks.frames import frame_pose

SOLE = np.array([(x, y, 0.0) for x in (0.1, -0.1) for y in (0.06, -0.06)])


def standing(palm: bool = False) -> Controller:
    tick = controller("talos").clone()
    tick.reset(robot("talos").neutral)
    tick["palm"].enabled = palm
    return tick


@cache
def plain() -> Region:
    return region(standing(), robot("talos").neutral, torque=False)


def hull() -> np.ndarray:
    bot = robot("talos")
    poses = [frame_pose(bot, f"{side}_sole_link", bot.neutral) for side in ("left", "right")]
    return np.concatenate([SOLE @ pose.rotation.T + pose.translation for pose in poses])[:, :2]


def test_on_level_ground_it_is_the_hull_of_the_soles() -> None:
    found, wanted = plain(), ConvexHull(hull())
    assert found.area == pytest.approx(wanted.volume, abs=2e-5)
    assert 0.0 <= found.error <= 1e-5
    offsets = wanted.equations[:, :2] @ found.corners.T + wanted.equations[:, 2:]
    # the soles of the description are not quite level
    assert offsets.max() < 1e-4
    center = pin.centerOfMass(robot("talos").model, robot("talos").model.createData(), robot("talos").neutral)
    here = -(wanted.equations @ np.r_[center[:2], 1.0]).max()
    assert found.margin() == pytest.approx(here, abs=1e-4)
    assert found.margin(center + np.array([1.0, 0.0, 0.0])) == pytest.approx(here - 1.0, abs=0.1)


def test_weak_motors_make_it_smaller_and_a_hand_makes_it_another() -> None:
    tick, q = standing(), robot("talos").neutral
    tick["torque_limits"].scale = 0.35
    weak = region(tick, q)
    assert weak.torque
    assert 1e-3 < weak.area < 0.95 * plain().area
    assert min(plain().margin(corner) for corner in weak.corners @ weak.axes) > -1e-6
    assert region(standing(palm=True), q, torque=False).area > 1.05 * plain().area


def test_planes_are_within_it() -> None:
    found = plain()
    for count in (3, 4, 12):
        planes = found.planes(count, inset=0.01)
        normals, offsets = planes["normals"].reshape(count, 3), planes["offsets"]
        used = offsets < 100.0
        assert used.sum() == min(count, len(found.corners))
        rng = np.random.default_rng(0)
        points = rng.uniform(-0.3, 0.3, (300, 3)) + found.center
        inside = (points @ normals[used].T <= offsets[used]).all(axis=1)
        assert inside.any()
        assert min(found.margin(point) for point in points[inside]) >= 0.01 - 1e-9


def test_the_capture_point_stays_within_where_the_rate_is_that_of_the_pendulum() -> None:
    """The centre of mass is told to leave: the distance of the capture point from the edge, (dh/dt + rate h) / rate,
    shrinks no faster than exp(-rate t).
    """
    bot, rate = robot("talos"), 3.5
    made = Stack(bot, dt=0.005).add(CenterOfMass(), name="com").add(Posture(), weight=1e-3)
    made.add(SupportRegion(planes=6), name="balance")
    tick = made.compile(command="acceleration", backend="vm")
    q, v = bot.neutral.copy(), np.zeros(bot.nv)
    tick.reset(q)
    planes = plain().planes(6)
    tick["balance"].set(**planes)
    tick["balance"].rate = rate
    tick["com"].set(stiffness=100.0, damping=20.0)
    tick["com"].target = plain().center + np.array([0.4, 0.3, 0.0])
    normals, offsets, least = planes["normals"].reshape(6, 3), planes["offsets"], np.inf
    data = bot.model.createData()
    for _ in range(60):
        step = tick.step(q, v)
        q, v = pin.integrate(bot.model, q, 0.5 * (v + step.v) * 0.005), step.v
        pin.centerOfMass(bot.model, data, q, v)
        least = min(least, float((offsets - normals @ (data.com[0] + data.vcom[0] / rate)).min()))
    assert least == pytest.approx(plain().margin() * (1.0 - 0.005 * rate) ** 60, rel=0.02)


def test_an_arm_that_nothing_limits_lacks_nothing() -> None:
    arm = robot("panda")
    tick = Stack(arm, DT).add(Posture(), name="posture").compile(command="torque", backend="vm")
    assert lacking(tick, arm.neutral) == ()


def test_what_is_lacking_is_named_in_newtons() -> None:
    tick, q = standing(), robot("talos").neutral
    weight = 9.81 * pin.computeTotalMass(robot("talos").model)
    assert lacking(tick, q) == ()
    tick["left foot"].most = tick["right foot"].most = 0.4 * weight
    found = lacking(tick, q)
    assert {f.item for f in found} <= {"left foot wrench", "right foot wrench"}
    assert sum(f.amount for f in found if f.row == "normal") == pytest.approx(0.2 * weight, rel=1e-4)
    assert {f.unit for f in found} <= {"N", "N m"}
    tick["left foot"].most = tick["right foot"].most = np.inf
    tick["torque_limits"].scale = 0.1
    found = lacking(tick, q)
    assert "torque_limits" in {f.item for f in found}
    assert str(found[0]).endswith("N m")
    tick["left foot"].enabled = tick["right foot"].enabled = False
    assert "base/root_joint.z by 886 N" in [str(f) for f in lacking(tick, q)]
    assert region(tick, q).area == 0.0
    with pytest.raises(RangeError, match="no planes"):
        region(tick, q).planes(4)


def test_a_picture_and_refusals() -> None:
    panel = Figure().add_subplot()
    plain().plot(panel, label="soles")
    assert len(panel.lines) == 2
    with pytest.raises(CommandError, match="base is fixed"):
        region(controller("panda"), robot("panda").neutral)
    with pytest.raises(RangeError, match="gravity"):
        region(controller("walker"), robot("walker").neutral)
    still = Stack(robot("panda"), dt=DT).add(Posture()).compile(command="acceleration", backend="vm")
    with pytest.raises(CommandError, match="compile the stack"):
        lacking(still, robot("panda").neutral)
    with pytest.raises(RangeError):
        SupportRegion(planes=2)
