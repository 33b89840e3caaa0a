"""The machines of the report: HERMIES-III's arm, AIRARM and a planar arm, on a platform or not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from wbc import robots, validation
from wbc.errors import ShapeError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.tasks._stereographic import triple
from wbc.validation import Array

#: Platforms: none, x and y and turn as they please, rolling without slip, or steered in front as well
BASES = ("none", "holonomic", "differential", "car")
#: Distance of a car's axles [m]; assumed
WHEEL_BASE = 0.8
#: Largest steering angle of a car [rad]; assumed
STEERING = math.radians(40.0)
#: HERMIES-III [m]: shoulder, upper arm, forearm, hand, tool. The first is 0.396 in what is legible, and 0.356 by the
#: published norms
HERMIES_LINKS = (0.356, 0.635, 0.508, 0.343, 0.029)
#: From the centre of HERMIES's platform to the arm [m]: 0.6 in what is legible, and 0.6100 by the norms of all three
#: trajectories
HERMIES_BASE = (-0.61, 0.0, 0.3)
#: From the centre of AIRARM's platform to the arm [m]
AIRARM_BASE = (0.0, 1.0, 0.0)
#: Radius of a disc that holds a platform [m]; assumed, the plate's size is not legible
PLATE = 0.5
#: AIRARM [m]: the last two by the position on a published screen; assumed
AIRARM_LINKS = (0.6096, 1.3716, 0.0, 0.4572, 0.2048)
#: The planar arm of the first tests [m]: not printed; assumed
PLANAR_LINKS = (0.25, 0.25, 0.25, 0.25)


@dataclass(frozen=True, eq=False)
class ArmMachine:
    """An arm, its columns in the report's order: joints of the arm, then x, y and turn of its platform.

    Attributes:
        robot: with real joints, those of the platform first; all of one degree of freedom. tip: its tool frame.
        spread: configuration of the robot = spread q [nv, M].
        ends: link ends from the arm's base to the tool, each (joint number in the model, place in its frame).
        home: [rad or m]. lower, upper: limits, buffers included. weights: b of each column, 1 for normal.
        prismatic: which columns are lengths. base: one of :data:`BASES`. plate: radius of its disc [m].
        assumed: what was not legible and is assumed here.
    """

    name: str
    robot: Robot
    tip: str
    spread: Array
    ends: tuple[tuple[int, tuple[float, float, float]], ...]
    home: Array
    lower: Array
    upper: Array
    weights: Array
    prismatic: tuple[bool, ...]
    base: str = "none"
    plate: float = PLATE
    assumed: tuple[str, ...] = ()

    @cached_property
    def _data(self) -> Any:
        return self.robot.model.createData()

    @cached_property
    def _tip(self) -> int:
        return int(self.robot.model.getFrameId(self.tip))

    @property
    def joints(self) -> int:
        """M."""
        return int(self.spread.shape[1])

    @cached_property
    def flat(self) -> bool:
        """Whether the tool stays in a plane of x and y, whatever the joints do; the platform is no arm."""
        rng = np.random.default_rng(0)
        tilts = [np.abs(self.jacobian(rng.uniform(-1.0, 1.0, self.joints))[2:5]).max() for _ in range(3)]
        return self.base == "none" and max(tilts) < 1e-12

    def checked(self, field: str, q: Any) -> Array:
        """A configuration of the columns.

        Raises:
            ShapeError, NotFiniteError: it is none.
        """
        return validation.ordinary_array(field, q, (self.joints,))

    def of_robot(self, q: Array) -> Array:
        return np.asarray(self.spread @ q)

    def place(self, q: Array) -> tuple[Array, Array]:
        """Position [3] and rotation [3, 3] of the tool in the world."""
        self._run(q)
        placed = pin.updateFramePlacement(self.robot.model, self._data, self._tip)
        return placed.translation.copy(), placed.rotation.copy()

    def jacobian(self, q: Array) -> Array:
        """Of the tool: velocity and angular velocity in world axes [6, M]."""
        self._run(q)
        frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = pin.getFrameJacobian(self.robot.model, self._data, self._tip, frame)
        return np.asarray(J @ self.spread)

    def points(self, q: Array) -> Array:
        """Ends of all links, the arm's base first [links + 1, 3]."""
        self._run(q)
        return np.array([self._data.oMi[j].act(np.array(p)) for j, p in self.ends])

    def point_jacobian(self, q: Array, link: int, point: Array) -> Array:
        """Of a point of the world fixed to a link: the arm truncated there, later joints move it not [3, M]."""
        self._run(q)
        joint, frame = self.ends[link + 1][0], pin.ReferenceFrame.WORLD
        J = pin.getJointJacobian(self.robot.model, self._data, joint, frame)
        return np.asarray((J[:3] + np.cross(J[3:].T, point).T) @ self.spread)

    def slide(self, q: Array) -> Array:
        """The row that wheels on a fixed axle hold at zero, no sideways motion [0 or 1, M]."""
        out = np.zeros((0 if self.base in ("none", "holonomic") else 1, self.joints))
        if len(out):
            out[0, -3:] = -math.sin(q[-1]), math.cos(q[-1]), 0.0
        return out

    def _run(self, q: Array) -> None:
        pin.computeJointJacobians(self.robot.model, self._data, self.of_robot(q))


def hermies(
    base: str = "none",
    links: Sequence[float] = HERMIES_LINKS,
    offset: Sequence[float] = HERMIES_BASE,
    elbow: float = 0.0,
) -> ArmMachine:
    """HERMIES-III's CESARm arm: 7 joints, 10 with its platform; consistent kinematics, tool along the hand.

    ``elbow``: an offset [m] after joint 3, which the published Jacobian has.

    Raises:
        UnknownNameError, ShapeError: a base or lengths that are none.
    """
    shoulder, upper, forearm, hand, tool = _lengths(links, 5)
    h = math.pi / 2
    chain = [
        ("RX", (-math.pi, -h, 0.0), (0.0, 0.0, 0.0)),
        ("RX", (h, 0.0, 0.0), (0.0, shoulder, 0.0)),
        ("RX", (-h, 0.0, h), (0.0, upper, 0.0)),
        ("RX", (0.0, h, 0.0), (0.0, elbow, 0.0)),
        ("RX", (0.0, 0.0, 0.0), (0.0, forearm, 0.0)),
        ("RX", (h, -h, -math.pi), (0.0, 0.0, 0.0)),
        ("RX", (-h, -math.pi, 0.0), (0.0, hand, 0.0)),
    ]
    ends = [(0, (0, 0, 0)), (1, (0, shoulder, 0)), (2, (0, upper, 0)), (4, (0, forearm, 0)), (7, (tool, 0, 0))]
    model = _assembled(base, offset, chain)
    _tool(model, (tool, 0.0, 0.0), h)
    home = np.zeros(7)
    home[1], home[5] = math.pi, h
    note = "first link 0.356 m by the norms; platform limits and plate"
    most = np.full(7, 2.0 * math.pi)
    return _machine("hermies", model, base, np.eye(7), ends, home=home, most=most, assumed=(note,))


def airarm(
    base: str = "none", links: Sequence[float] = AIRARM_LINKS, offset: Sequence[float] = AIRARM_BASE
) -> ArmMachine:
    """AIRARM, the munitions handler: joint 3 slides, joint 4 is slaved and keeps the wrist level, so that its column is
    zero; position only.

    Raises:
        UnknownNameError, ShapeError: a base or lengths that are none.
    """
    lower, upper, _, wrist, tool = _lengths(links, 5)
    chain = [
        ("RY", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ("RY", (0.0, 0.0, 0.0), (0.0, 0.0, lower)),
        ("PZ", (0.0, 0.0, 0.0), (0.0, 0.0, upper)),
        ("RY", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        ("RZ", (0.0, 0.0, 0.0), (wrist, 0.0, 0.0)),
    ]
    ends = [(0, (0, 0, 0)), (1, (0, 0, lower)), (3, (0, 0, 0)), (4, (wrist, 0, 0)), (5, (tool, 0, 0))]
    model = _assembled(base, offset, chain)
    _tool(model, (tool, 0.0, 0.0), 0.0)
    # The wrist's joint is slaved to the first two: -(q1 + q2), and the tool's turns backwards
    spread = np.diag([1.0, 1.0, 1.0, 0.0, -1.0])
    spread[3, :2] = -1.0
    home = np.array([math.radians(-30.0), math.radians(135.0), 0.3048, 0.0, 0.0])
    limits = np.array([[-math.pi, math.radians(10.0), 0.0, -2.0 * math.pi, -math.pi / 2]])
    most = np.array([math.pi, math.radians(160.0), 24 * 0.0254, 2.0 * math.pi, math.pi / 2])
    notes = "third to fifth link", "limits of joint 1 and of the platform", "home"
    made = _machine("airarm", model, base, spread, ends, home=home, most=most, assumed=notes, prismatic=(2,))
    made.lower[:5] = limits
    return made


def planar(links: Sequence[float] = PLANAR_LINKS) -> ArmMachine:
    """The planar arm of the first FSP tests, one joint a link; tasks x, y and yaw.

    Raises:
        ShapeError: no lengths.
    """
    lengths = _lengths(links, len(tuple(links)))
    places = [(0.0, 0.0, 0.0), *((one, 0.0, 0.0) for one in lengths[:-1])]
    model = _assembled("none", (0, 0, 0), [("RZ", (0.0, 0.0, 0.0), place) for place in places])
    _tool(model, (lengths[-1], 0.0, 0.0), 0.0)
    ends: list[Any] = [(0, (0, 0, 0)), *((k + 1, (one, 0.0, 0.0)) for k, one in enumerate(lengths))]
    home = np.full(len(lengths), 0.5)
    most = np.full(len(lengths), math.pi)
    return _machine("planar", model, "none", np.eye(len(lengths)), ends, home=home, most=most, assumed=("all links",))


def machine_of(robot: Robot, tip: str) -> ArmMachine:
    """Any robot of joints of one degree of freedom: its columns are those joints, its links go from one to the next.

    Raises:
        ShapeError: a joint of several degrees of freedom. UnknownNameError: no such frame.
    """
    if robot.nq != robot.nv:
        raise ShapeError("robot", robot.name, "expected joints of one degree of freedom each")
    model, frame = robot.model, robot.model.frames[robot.model.getFrameId(robot.check_frame("tip", tip))]
    chain = [int(k) for k in model.supports[frame.parentJoint]][1:]
    places = [(0, model.jointPlacements[chain[0]].translation)]
    places += [(a, model.jointPlacements[b].translation) for a, b in pairwise(chain)]
    ends = tuple((j, triple(p)) for j, p in [*places, (chain[-1], frame.placement.translation)])
    bounds = robot.limits.position_lower, robot.limits.position_upper
    low, high = (np.where(np.isfinite(x), x, np.sign(x) * 1e3) for x in bounds)
    still = tuple(unit == "m" for unit in robot.dof_units)
    one = np.ones(robot.nv)
    return ArmMachine(
        robot.name,
        robot,
        tip,
        np.eye(robot.nv),
        ends,
        robot.neutral.copy(),
        low,
        high,
        one,
        still,
    )


def without_platform(machine: ArmMachine) -> ArmMachine:
    """The same machine with its platform at rest: columns 8 to 10 of HERMIES are gone, as its M = 7 says."""
    if machine.base == "none":
        return machine
    keep = slice(0, machine.joints - 3)
    parts = {k: getattr(machine, k)[keep] for k in ("home", "lower", "upper", "weights", "prismatic")}
    return replace(machine, spread=machine.spread[:, keep], base="none", **parts)


def _lengths(links: Sequence[float], count: int) -> list[float]:
    return [float(x) for x in validation.ordinary_array("links", links, (count,))]


def _assembled(base: str, offset: Sequence[float], chain: Sequence[Any]) -> pin.Model:
    """A model with the platform's joints, if any, and the chain: (joint, z-y-x angles, place) each."""
    validation.one_of("base", base, BASES)
    model, parent, at = pin.Model(), 0, pin.SE3.Identity()
    if base != "none":
        for kind, name in (("PX", "x"), ("PY", "y"), ("RZ", "turn")):
            parent = model.addJoint(parent, getattr(pin, f"JointModel{kind}")(), pin.SE3.Identity(), name)
            model.addFrame(pin.Frame(f"link{parent}", parent, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        at = pin.SE3(np.eye(3), validation.ordinary_array("offset", offset, (3,)))
    for number, (kind, (a, b, g), place) in enumerate(chain, 1):
        turn = pin.utils.rotate("z", a) @ pin.utils.rotate("y", b) @ pin.utils.rotate("x", g)
        joint = getattr(pin, f"JointModel{kind}")()
        parent = model.addJoint(parent, joint, at * pin.SE3(turn, np.array(place)), f"joint{number}")
        model.addFrame(pin.Frame(f"link{parent}", parent, 0, pin.SE3.Identity(), pin.FrameType.BODY))
        at = pin.SE3.Identity()
    return model


def _tool(model: pin.Model, place: tuple[float, float, float], turn: float) -> None:
    placed = pin.SE3(pin.utils.rotate("y", turn), np.array(place))
    model.addFrame(pin.Frame("tip", model.njoints - 1, 0, placed, pin.FrameType.OP_FRAME))


def _machine(
    name: str, model: pin.Model, base: str, spread: Array, ends: Any, *, home: Array, most: Array,
    assumed: tuple[str, ...], prismatic: tuple[int, ...] = (),
) -> ArmMachine:  # fmt: skip
    arm, first = len(home), model.nv - len(home)
    whole = np.zeros((model.nv, model.nv))
    whole[first:, :arm] = spread
    whole[:first, arm:] = np.eye(first)
    free = [100.0, 100.0, 2.0 * math.pi][:first]
    upper = np.concatenate((most, free))
    sliding = tuple(k in prismatic or arm <= k < arm + 2 for k in range(model.nv))
    ends = tuple((j + first if j else 0, triple(p)) for j, p in ends)
    if first:
        # The arm's base rides on the platform
        ends = ((first, triple(model.jointPlacements[first + 1].translation)), *ends[1:])
    limits = whole @ upper, whole @ -upper
    bounds = {"position_lower": np.minimum(*limits), "position_upper": np.maximum(*limits)}
    robot = robots.load(model, name=name, **bounds)
    start = np.concatenate((home, np.zeros(first)))
    return ArmMachine(
        name,
        robot,
        "tip",
        whole,
        ends,
        start,
        -upper,
        upper,
        np.ones(model.nv),
        sliding,
        base,
        assumed=assumed,
    )
