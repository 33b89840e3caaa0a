"""Every shipped class of item: examples of it on each of the test robots, and what tests of all items need to know.

Whoever adds a class adds its row to :data:`ITEMS`; walks over all items take their parameters from there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin

from tests import rates
from tests.rates import AROUND, AXIS, GROUND, OFFSET, SEEN, TILTED, single_joints
from tests.tasks.robots import FRAMES, Frames
from wbc import tasks
from wbc.robot import Robot
from wbc.robot.transmission import Transmission
from wbc.shapes import Capsule, HalfSpace, Sphere

#: An item and the run-time values that a test may not draw at random
Declared = tuple[tasks.Item, dict[str, Any]]

CONTACT = {"gain": 3.0, "friction": 0.5, "least": 1.0, "most": 200.0}
MOVED = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.1])), np.array([0.2, 0.3, -0.1]))


@dataclass(frozen=True, eq=False)
class Kind:
    """What tests of every item know of a class.

    Attributes:
        examples: items on a robot and its frames, some of them with run-time values of their own.
        given: run-time values of every example that a test may not draw at random.
        rate: what the rows times v are, by Pinocchio, where they are not the derivative of a value.
        own_rows: a task that always gives its own rows, which then have no value to differentiate.
        velocity: whether a stack that commands velocities takes it.
        force: about contacts and torques, which closed loops of velocities do not show.
    """

    examples: Callable[[Frames, Robot], Iterable[tasks.Item | Declared]]
    given: Mapping[str, Any] = field(default_factory=dict)
    rate: Callable[..., np.ndarray] | None = None
    own_rows: bool = False
    velocity: bool = True
    force: bool = False

    def __call__(self, robot: Robot) -> list[Declared]:
        """The examples on a robot, each with its run-time values."""
        pairs = [e if isinstance(e, tuple) else (e, {}) for e in self.examples(FRAMES[robot.name], robot)]
        return [(item, {**self.given, **own}) for item, own in pairs]


def _height(f: Frames) -> tasks.Expression:
    return tasks.Expression(
        lambda kin, p: kin.position(f.tip)[2] - p["height"],
        units="m",
        inputs=(
            tasks.Input("height", unit="m", default=0.4, rate="speed"),
            tasks.Input("speed", unit="m/s", default=0.0),
        ),
    )


def _mixed(f: Frames, robot: Robot) -> tasks.Expression:
    return tasks.Expression(
        lambda kin, p: [
            kin.center_of_mass() - p["place"].point(kin.position(f.middle)),
            kin.joint(robot.joint_names[-1]) * ca.dot(kin.rotation(f.tip)[:, 0], p["turn"][:, 1]),
            ca.sin(kin.rotation_error(f.tip, f.base, p["turn"])[0]),
        ],
        units=("m", "m", "m", "rad", "rad"),
        inputs=(
            tasks.Input("place", "pose", default=np.eye(4), rate="twist"),
            tasks.Input("twist", size=6, default=np.zeros(6)),
            tasks.Input("turn", "rotation", default=np.eye(3), rate="spin"),
            tasks.Input("spin", size=3, default=np.zeros(3)),
        ),
    )


def _coupling(f: Frames, robot: Robot) -> list[tasks.Item]:
    a, b, *_, c = single_joints(robot)
    # joints without end need whole numbers
    whole = 2 if robot.name == "kinova" else 1.5
    return [
        tasks.JointCoupling({a: 1, b: -1}),
        tasks.JointCoupling([{a: 1, b: -whole, c: -3}, {c: 1}], target=None, weights=(1, 2)),
        tasks.JointCoupling([{b: 1, c: -3}], target=0.3),
    ]


def _rolling(f: Frames, robot: Robot) -> list[tasks.Item | Declared]:
    """Any joint turns a wheel, as far as the rows are concerned."""
    carried = [j for j in single_joints(robot) if int(robot.model.parents[robot.model.getJointId(j)]) > 0]
    slanted = [j for j in carried if abs(rates.wheel_axis(robot, j, robot.neutral)[2]) < 0.9]
    plain, omni, mecanum = (
        tasks.Wheel(slanted[0], 0.1),
        tasks.Wheel(slanted[1], 0.2, 0.0),
        tasks.Wheel(slanted[-1], 0.05, -math.pi / 4),
    )
    return [tasks.Rolling((plain, omni, mecanum)), (tasks.Rolling(plain, contact=True), {"gain": 3.0})]


def _rolling_contact(f: Frames, robot: Robot) -> list[tasks.Item]:
    frame, axis = rates.wheel(robot)
    return [tasks.RollingContact(frame, radius=0.2, axis=axis)]


def _obstacle(f: Frames, robot: Robot) -> list[tasks.Item]:
    link = tasks.Obstacle(HalfSpace()).pairs(robot)[0][0]
    return [tasks.Obstacle(shape, links=link) for shape in (Sphere(0.1), HalfSpace(), Capsule(0.05, 0.2))]


def _self_collision(f: Frames, robot: Robot) -> list[tasks.Item | Declared]:
    links = [link for link, shapes in robot.shapes.items() if shapes]
    # A link near the base and the one that most joints move: their distance takes many values
    model = robot.model
    depth = {link: len(model.supports[model.frames[model.getFrameId(link)].parentJoint]) for link in links}
    far = (links[0], max(links[1:], key=lambda link: depth[link]))
    some = [(a, b) for k, a in enumerate(links) for b in links[k + 1 :] if (a, b) != far]
    return [
        (tasks.SelfCollision([far], method="symbolic"), {"margin": 0.02}),
        tasks.SelfCollision(some[:3], margin=0.01),
    ]


def _drives(f: Frames, robot: Robot) -> list[tasks.Item]:
    followers = {robot.dof_names[c.follower] for c in robot.couplings}
    a, b = [name for name in single_joints(robot) if name not in followers][:2]
    wrist = Transmission((a, b), {"left": {a: 1.0, b: 1.0}, "right": {a: 1.0, b: -1.0}})
    return [tasks.DriveTorqueLimits(wrist, torque=(5.0, np.inf))]


#: Class name -> what is known of it
ITEMS: dict[str, Kind] = {
    "EndEffector": Kind(
        lambda f, robot: [
            tasks.EndEffector(f.tip),
            tasks.EndEffector(f.tip, axes="frame"),
            tasks.EndEffector(f.tip, axes=f.base),
            tasks.EndEffector(f.tip, relative_to=f.base),
            tasks.EndEffector(f.tip, relative_to=f.base, axes="world", weights=(1, 2, 3, 4, 5, 0)),
            tasks.EndEffector(f.tip, relative_to=f.base, axes="frame"),
            tasks.EndEffector(f.tip, relative_to=f.base, axes=f.middle),
            tasks.EndEffector(f.tip, kind="position", relative_to=f.base, axes=f.middle),
            tasks.EndEffector(f.tip, kind="position"),
            tasks.EndEffector(f.tip, kind="orientation", axes="frame"),
            tasks.EndEffector(f.tip, kind="orientation", relative_to=f.base),
        ]
    ),
    "Elbow": Kind(
        lambda f, robot: [
            tasks.Elbow(f.middle),
            tasks.Elbow(f.middle, offset=OFFSET),
            tasks.Elbow(f.middle, offset=OFFSET, axes="frame"),
            tasks.Elbow(f.middle, offset=OFFSET, axes=f.tip),
        ]
    ),
    "Posture": Kind(
        lambda f, robot: [
            tasks.Posture(),
            tasks.Posture(joints=(robot.joint_names[-1], robot.joint_names[0])),
            tasks.Posture(start="neutral"),
        ]
    ),
    "Damping": Kind(
        lambda f, robot: [tasks.Damping(), tasks.Damping(weights=range(1, robot.nv + 1))],
        rate=rates.damping,
        own_rows=True,
    ),
    "CenterOfMass": Kind(lambda f, robot: [tasks.CenterOfMass(), tasks.CenterOfMass(axes=f.tip)]),
    "Expression": Kind(lambda f, robot: [_height(f), _mixed(f, robot)]),
    "PitchPlane": Kind(
        lambda f, robot: [
            tasks.PitchPlane(*f.plane),
            tasks.PitchPlane(*f.plane, axis=f.axis),
            tasks.PitchPlane(*f.plane, elbow_offset=(0.02, 0.03, -0.01), base=f.base),
        ],
        rate=rates.plane,
    ),
    "PitchPlaneLimit": Kind(lambda f, robot: [tasks.PitchPlaneLimit(*f.plane, lower=-0.5, upper=1.0)]),
    "AxisAlign": Kind(
        lambda f, robot: [
            tasks.AxisAlign(f.tip),
            tasks.AxisAlign(f.tip, axis=AXIS, around=AROUND),
            tasks.AxisAlign(f.tip, axis=AXIS, around=AROUND, relative_to=f.base),
        ],
        rate=rates.spin_across,
        own_rows=True,
    ),
    "LookAt": Kind(
        lambda f, robot: [
            tasks.LookAt(f.tip),
            tasks.LookAt(f.tip, axis=AXIS, around=AROUND, offset=OFFSET),
            tasks.LookAt(f.tip, axis=AXIS, around=AROUND, offset=OFFSET, relative_to=f.base),
        ],
        {"target": np.array(SEEN)},
        rate=rates.spin_past_sight,
        own_rows=True,
    ),
    "Distance": Kind(
        lambda f, robot: [
            tasks.Distance(f.tip),
            tasks.Distance(f.middle, offset=OFFSET),
            tasks.Distance(f.tip, f.base, offset=OFFSET),
        ]
    ),
    "Momentum": Kind(
        lambda f, robot: [tasks.Momentum(), tasks.Momentum("linear", weights=(1, 1, 0)), tasks.Momentum("angular")],
        rate=rates.momentum,
        own_rows=True,
    ),
    "RelativePose": Kind(
        lambda f, robot: [
            tasks.RelativePose(f.base, f.tip),
            tasks.RelativePose(f.base, f.tip, axes=f.base),
            tasks.RelativePose(f.base, f.tip, axes="world", weights=(1, 2, 3, 4, 5, 0)),
            tasks.RelativePose(f.middle, f.tip, axes=f.base, at=OFFSET),
            tasks.RelativePose(f.base, f.tip, kind="position"),
            tasks.RelativePose(f.base, f.tip, kind="position", axes=f.tip),
            tasks.RelativePose(f.tip, f.base, kind="orientation"),
            tasks.RelativePose(f.tip, f.base, kind="orientation", axes=f.middle),
        ]
    ),
    "JointCoupling": Kind(_coupling),
    # The humanoid's moving frame elsewhere is a sole; from there, as from the world, an arm is never singular
    "Manipulability": Kind(
        lambda f, robot: [
            tasks.Manipulability(f.tip, kind="position"),
            tasks.Manipulability(f.tip, kind="orientation", form="log"),
            tasks.Manipulability(f.tip, length=0.3),
            tasks.Manipulability(f.tip, along=("z", "rx"), relative_to=f.base),
            tasks.Manipulability(f.base, along=("y",), relative_to=f.tip),
        ]
    ),
    "Rolling": Kind(_rolling, {"ground": GROUND}, rate=rates.rolling),
    "JointLimits": Kind(
        lambda f, robot: [
            tasks.JointLimits(),
            (tasks.JointLimits(margin=1e-3), {"velocity_scale": 0.5, "return_rate": 2.0}),
            tasks.JointLimits(shortest_dt=0.002, joints=robot.joint_names[-1]),
            tasks.JointLimits(position=False),
            tasks.JointLimits(acceleration=False),
        ]
    ),
    "FrameVelocityLimit": Kind(
        lambda f, robot: [
            tasks.FrameVelocityLimit(f.tip, linear=0.5, angular=1.0),
            (tasks.FrameVelocityLimit(f.tip, linear=(0.1, 0.2, math.inf), axes=f.tip), {"linear": [0.3, 0.0]}),
            tasks.FrameVelocityLimit(f.tip, linear=0.5, angular=1.0, relative_to=f.base),
        ],
        rate=rates.frame_velocity,
    ),
    "Hold": Kind(
        lambda f, robot: [tasks.Hold(f.tip, kind) for kind in ("pose", "position", "orientation", "axis")],
        {"gain": 3.0},
        rate=rates.hold,
    ),
    "Fixed": Kind(
        lambda f, robot: [tasks.Fixed(robot.joint_names[-1]), tasks.Fixed(robot.joint_names[:2], acceleration=False)]
    ),
    "Mechanism": Kind(lambda f, robot: [tasks.Mechanism()], {"gain": 3.0}, rate=rates.mechanism),
    "Obstacle": Kind(_obstacle, {"pose": MOVED, "velocity": [0.1, -0.2, 0.3, 0.4, -0.5, 0.6], "margin": 0.01}),
    "SelfCollision": Kind(_self_collision),
    "WorkspaceBox": Kind(
        lambda f, robot: [
            tasks.WorkspaceBox(f.tip, lower=(-1, -2, -3), upper=(1, 2, 3)),
            tasks.WorkspaceBox(f.tip, lower=-1.0, relative_to=f.base, offset=OFFSET),
            tasks.WorkspaceBox(f.tip, upper=1.0, offset=OFFSET),
        ]
    ),
    "WorkspacePolyhedron": Kind(
        lambda f, robot: [
            tasks.WorkspacePolyhedron(
                f.tip, [(0, 0, 2), (1, -1, 0.5), (-0.3, 0.2, -0.1)], offsets=[0.1, 0.2, -0.3], pose=MOVED
            ),
            tasks.WorkspacePolyhedron(f.tip, [(1, -1, 0.5), (-0.3, 0.2, -0.1)], relative_to=f.base, offset=OFFSET),
        ]
    ),
    "AxisCone": Kind(
        lambda f, robot: [
            tasks.AxisCone(f.tip, 0.4),
            (tasks.AxisCone(f.tip, 2.0, axis=(1, -2, 0.5)), {"half_angle": 2.0}),
            tasks.AxisCone(f.tip, 1.0, axis=(0, 0, -1), direction=(1, 0, 0), relative_to=f.base),
        ]
    ),
    "GazeCone": Kind(
        lambda f, robot: [
            tasks.GazeCone(f.tip, 0.4, apex=OFFSET),
            (tasks.GazeCone(f.tip, 2.0, axis=(1, -2, 0.5), point_frame=f.base), {"half_angle": 2.0}),
            tasks.GazeCone("world", 1.0, point_frame=f.tip),
        ]
    ),
    "Limit": Kind(
        lambda f, robot: [
            tasks.Limit(tasks.EndEffector(f.tip), lower=-0.1, upper=np.arange(1, 7)),
            tasks.Limit(tasks.EndEffector(f.tip, kind="position", axes=f.base), lower=(-1, 0), only=("z", "x")),
            tasks.Limit(tasks.CenterOfMass(), upper=0.3, only="z"),
            tasks.Limit(tasks.Elbow(f.middle, offset=OFFSET), lower=-0.3, upper=0.3),
            tasks.Limit(_height(f), lower=-0.3, upper=0.3),
            (tasks.Limit(tasks.PitchPlane(*f.plane), lower=-0.5, upper=1.0), {"lower": [-0.5], "upper": [1.0]}),
            tasks.Limit(
                tasks.PitchPlane(
                    *f.plane,
                    axis=f.axis,
                    reference=tasks.PlaneReference(pole=(0.0, 1.0, 0.2), direction=(1.0, 0.0, 0.0)),
                ),
                lower=-0.5,
            ),
        ]
    ),
    "RigidGrasp": Kind(
        lambda f, robot: [
            tasks.RigidGrasp(f.tip),
            (
                tasks.RigidGrasp(f.tip, force=(100.0, np.inf, 50.0), torque=20.0),
                {"force": np.array([50.0, 60.0, 70.0]), "torque": np.full(3, 20.0)},
            ),
        ],
        {"gain": 3.0},
        rate=rates.contact,
        force=True,
    ),
    "PointContact": Kind(
        lambda f, robot: [tasks.PointContact(f.tip), tasks.PointContact(f.tip, friction=0.8, edges=7)],
        CONTACT,
        rate=rates.contact,
        force=True,
    ),
    "SurfaceContact": Kind(
        lambda f, robot: [tasks.SurfaceContact(f.tip, half_lengths=(0.1, 0.05))],
        CONTACT,
        rate=rates.contact,
        force=True,
    ),
    "LineContact": Kind(
        lambda f, robot: [tasks.LineContact(f.tip, half_length=0.07)], CONTACT, rate=rates.line_contact, force=True
    ),
    "SlidingContact": Kind(
        lambda f, robot: [tasks.SlidingContact(f.tip)],
        CONTACT | {"slow": 0.02, "target": TILTED},
        rate=rates.sliding,
        force=True,
    ),
    "RollingContact": Kind(_rolling_contact, CONTACT | {"target": TILTED}, rate=rates.rolling_contact, force=True),
    "SupportRegion": Kind(lambda f, robot: [tasks.SupportRegion(planes=4)], force=True),
    "DivergentComponent": Kind(
        lambda f, robot: [tasks.DivergentComponent(omega=3.5)], {"omega": 2.0, "gain": 4.0}, velocity=False, force=True
    ),
    "ExternalWrench": Kind(lambda f, robot: [tasks.ExternalWrench(f.tip)], velocity=False, force=True),
    "JointFriction": Kind(
        lambda f, robot: [tasks.JointFriction(viscous=0.2, coulomb=0.4, slow=0.02)], velocity=False, force=True
    ),
    "TorqueLimits": Kind(
        lambda f, robot: [tasks.TorqueLimits(), tasks.TorqueLimits(robot.joint_names[-1], slew=100.0)],
        velocity=False,
        force=True,
    ),
    "DriveTorqueLimits": Kind(_drives, velocity=False, force=True),
    "WrenchSum": Kind(lambda f, robot: [tasks.WrenchSum("contact")], velocity=False, force=True),
}

#: Classes that have no meaning for a stack that commands velocities
NO_VELOCITIES = frozenset(name for name, kind in ITEMS.items() if not kind.velocity)
#: Classes that a stack of velocities takes. A mechanism is in every stack of a robot that needs one
SWITCHED = sorted(ITEMS.keys() - {"Mechanism"} - NO_VELOCITIES)
