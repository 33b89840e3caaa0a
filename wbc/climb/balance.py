"""Whether contacts bear a robot at rest, and with how much to spare: an exact linear program."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB
from wbc.climb.world import ClimbWorld, held_pose
from wbc.errors import RangeError, ShapeError
from wbc.linear_program import least
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

#: So many motors that lack torque are named
NAMED = 3
#: What a share of the weight that contacts cannot balance costs, beside one of a motor's effort
UNBALANCED = 100.0
#: What lacks less than this counts as rounding [N m; N; weights]
COUNTS = 1e-6


class Equilibrium:
    """Contacts of a climber in a scene.

        max t <= 1   over wrenches w  with  sum of w = -m g at the centre of mass,   A w + s t m |g| <= b of all

    with s = 1 for rows of forces of unit length: t is the share of the weight by which each contact's forces may be
    wrong along any row of its cone. Friction is the lower one of limb and foothold. A row that bears nothing at all
    (moments of a point) takes no part. Rows of moments alone count by the lever of the kind, the ratio of its largest
    moments and forces.

    Args:
        climber, scene: the robot and what it climbs.
        friction: share of the coefficients of friction that counts, and its square of soles [1].

    :class:`wbc.climb.path_loads.PathLoads` adds what motion needs.
    """

    def __init__(self, climber: Climber, scene: ClimbScene, friction: float = 1.0) -> None:
        self.climber = validation.instance("climber", climber, Climber, "a Climber")
        self.scene = validation.instance("scene", scene, ClimbScene, "a ClimbScene")
        share = validation.scalar("friction", friction, low=0.0, high=1.0)
        self.world = ClimbWorld(climber, scene, friction=share)

    def margin(self, contacts: Sequence[int], q: Array, *, motors: bool = False, effort: float = 1.0) -> float:
        """Slack t [1] of contacts at a configuration; below 0 they do not bear the robot, and by -t of its weight each
        contact lacks. -inf: their wrenches span no six directions; +inf: nothing weighs, and they hold the body.

        Args:
            contacts: for each limb the row of its foothold, or ``FREE_LIMB``.
            motors: whether torques at rest stay within the efforts of the joints as well; -inf where they cannot.
            effort: share of the efforts that counts then [1].

        Raises:
            ShapeError, RangeError: contacts that are none; a q of another shape.
        """
        held = self._checked(contacts)
        at = validation.real_array("q", q, (self.climber.robot.nq,))
        if motors:
            return self._with_motors(held, at, effort)
        return self.world.slack(self.world.places_of(held), self.climber.center_of_mass(at), self._poses(held, at))[0]

    def lacking(self, contacts: Sequence[int], q: Array, effort: float = 1.0) -> list[tuple[str, float]]:
        """Which joints' motors lack how much torque [N m; N] to hold the robot at rest with a share of their efforts,
        the worst first; ``contacts`` lack shares of the weight that they do not bear. Empty where nothing lacks.

            minimise  sum of s / size    over wrenches and s >= 0 with  G w = r,  A w - s <= b

        Args:
            contacts, q, effort: as of :meth:`margin`.

        Raises:
            ShapeError, RangeError: contacts that are none.
        """
        held, weight = self._checked(contacts), self.world.weight
        if self._with_motors(held, q, effort) >= 0.0:
            return []
        G, r, A, _, b, motors = self._program(held, q, effort)
        cones, limits = len(A) - 2 * len(motors), self.climber.robot.limits.effort[motors] / weight
        sizes = np.concatenate([np.ones(cones), limits, limits])
        # What no wrench of these contacts balances at all is the contacts' as well
        base = np.vstack([np.eye(6), -np.eye(6)]).T
        rows, count = np.hstack([A, -np.diag(sizes), np.zeros((len(A), 12))]), G.shape[1]
        cost = np.concatenate([np.zeros(count), np.ones(len(A)), np.full(12, UNBALANCED)])
        free = [(None, None)] * count + [(0.0, None)] * (len(A) + 12)
        answer = least(cost, rows, b, np.hstack([G, np.zeros((6, len(A))), base]), r, free)
        over = answer.x[count : count + len(A)] * sizes
        names = [self.climber.robot.dof_names[dof] for dof in motors]
        both = np.maximum(over[cones : cones + len(motors)], over[cones + len(motors) :]) * weight
        lacks = [("contacts", float(over[:cones].max(initial=0.0) + answer.x[count + len(A) :].sum()))]
        lacks += sorted(zip(names, both.tolist(), strict=True), key=lambda lack: -lack[1])
        return [(name, amount) for name, amount in lacks if amount > COUNTS]

    def told(self, contacts: Sequence[int], lacks: Sequence[tuple[str, float]]) -> str:
        """In words what of :meth:`lacking` the robot cannot stand without."""
        robot, forces = self.climber.robot, {"m": "N", "rad": "N m"}
        units = {name: forces[unit] for name, unit in zip(robot.dof_names, robot.dof_units, strict=True)}
        limbs = [limb.name for limb, row in zip(self.climber.limbs, contacts, strict=True) if row != FREE_LIMB]
        parts = [
            f"{1e2 * amount:.3g} % of its weight" if name == "contacts" else f"{amount:.3g} {units[name]} of {name}"
            for name, amount in lacks[:NAMED]
        ]
        strength = float(np.linalg.norm(self.scene.gravity))
        on = " and ".join(limbs) or "no limb"
        return f"under {strength:.3g} m/s^2 it cannot stand on {on}: {', '.join(parts)} are lacking"

    def wrench_slacks(self, contacts: Sequence[int], q: Array, point: Array, wrenches: Array) -> tuple[Array, Array]:
        """Slacks of contacts, turned as in a configuration, for wrenches that they have to give, and their bounds: as
        of :meth:`ClimbWorld.wrench_slacks`.

        Raises:
            ShapeError, RangeError: contacts that are none.
        """
        held = self._checked(contacts)
        return self.world.wrench_slacks(self.world.places_of(held), self._poses(held, q), point, wrenches)

    def driven_shares(
        self, contacts: Sequence[int], q: Array, effort: float, wrenches: Array, torques: Array
    ) -> list[float]:
        """Which share of a motion contacts and motors can give beside what they give at rest, at most 1,

            maximise  l    over wrenches and l  with  G w = r + l W,  A w <= b,  |tau - J'w + l T| <= effort tau_max

        Args:
            contacts, q, effort: as of :meth:`margin`.
            wrenches: W of some motions ``(k, 6)``, about the centre of mass, in weights. torques: T ``(k, nv)``.

        Raises:
            ShapeError, RangeError: contacts that are none.
        """
        G, r, A, s, b, motors = self._program(self._checked(contacts), q, effort)
        tied, none, shares = np.append(np.zeros(len(s)), 1.0), np.zeros(len(A) - 2 * len(motors)), list[float]()
        for wrench, torque in zip(wrenches, torques[:, motors], strict=True):
            column = np.concatenate([none, torque, -torque, [-1.0]])[:, None]
            rows = np.hstack([np.vstack([A, np.zeros(A.shape[1])]), column])
            given = np.hstack([G, -wrench[:, None]]), r, rows, tied, np.append(b, 0.0)
            shares.append(self.world.largest_slack(*given))
        return shares

    @cached_property
    def moving_model(self) -> pin.Model:
        """The robot's model in the gravity of the scene."""
        model = self.climber.robot.model.copy()
        model.gravity.linear = np.array(self.scene.gravity, dtype=np.float64)
        return model

    def _checked(self, contacts: Sequence[int]) -> tuple[int, ...]:
        held = tuple(int(row) for row in contacts)
        if len(held) != len(self.climber.limbs):
            raise ShapeError("contacts", contacts, f"expected {len(self.climber.limbs)}, one for each limb")
        for row in held:
            if not FREE_LIMB <= row < len(self.scene.footholds):
                raise RangeError("contacts", row, f"expected rows from 0 to {len(self.scene.footholds) - 1}, or -1")
        for limb, (row, at) in enumerate(zip(held, self.world.places_of(held), strict=True)):
            if row >= 0 and self.world.cone_of[limb, at] < 0:
                name, hold = self.climber.limbs[limb].name, self.scene.footholds[row]
                raise RangeError("contacts", row, f"foothold {hold.id} is for {', '.join(hold.limbs)}, not for {name}")
        return held

    def _poses(self, held: tuple[int, ...], q: Array) -> Array:
        """Poses of the contacts ``(limbs, 12)``: those of the footholds, turned about the normal as the limbs are."""
        poses = [place(held_pose(self.climber, self.scene, limb, row, q)) for limb, row in enumerate(held)]
        return np.ascontiguousarray(poses)

    def _with_motors(self, held: tuple[int, ...], q: Array, effort: float) -> float:
        """The slack with torques of motors within their efforts, which take no part in it."""
        G, r, A, s, b, _ = self._program(held, q, effort)
        slack = self.world.largest_slack(G, r, A, s, b)
        return slack if not self.world.numbers.weightless else (np.inf if slack > 0.0 else -np.inf)

    def _program(
        self, held: tuple[int, ...], q: Array, effort: float
    ) -> tuple[Array, Array, Array, Array, Array, list[int]]:
        """G, r, A, s and b of G x = r and A x + s t <= b, in weights, moments about the centre of mass: rows of the
        contacts, then one for each sign of the torque of the motors, which come last.
        """
        robot, weight, gravity = self.climber.robot, self.world.weight, np.asarray(self.scene.gravity)
        model, data, center = robot.model, robot.model.createData(), self.climber.center_of_mass(q)
        pin.computeJointJacobians(model, data, q)
        own = -(self.climber.mass * pin.jacobianCenterOfMass(model, data, q)).T @ gravity / weight
        maps, pulled, cones = [np.zeros((6, 0))], [np.zeros((model.nv, 0))], []
        for limb, (at, pose) in enumerate(zip(self.world.places_of(held), self._poses(held, q), strict=True)):
            if at < 0:
                continue
            cone, turn = self.world.cone(limb, at), pose[:9].reshape(3, 3)
            force, moment = turn @ cone.N[:3], turn @ cone.N[3:]
            frame = frame_index(model, self.climber.limbs[limb].frame)
            pin.updateFramePlacement(model, data, frame)
            J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            for out, by, point in ((maps, np.eye(6), center), (pulled, J.T, data.oMf[frame].translation)):
                out.append(by @ np.vstack([force, moment + np.cross(pose[9:] - point, force, axisb=0, axisc=0)]))
            cones.append(cone)
        motors = [dof for dof in robot.motors if np.isfinite(robot.limits.effort[dof])]
        torque, most = -np.hstack(pulled)[motors], effort * robot.limits.effort[motors] / weight
        A = np.vstack([block_diag(np.zeros((0, 0)), *(cone.A for cone in cones)), torque, -torque])
        s = np.concatenate([*(cone.s for cone in cones), np.zeros(2 * len(motors))])
        b = np.concatenate([*(cone.b / weight for cone in cones), most - own[motors], most + own[motors]])
        return np.hstack(maps), np.concatenate([-gravity * self.climber.mass / weight, np.zeros(3)]), A, s, b, motors
