"""Whether contacts bear a robot at rest, and with how much to spare: an exact linear program."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.optimize import linprog

from wbc import validation
from wbc.climb.climber import Climber
from wbc.climb.scene import ClimbScene
from wbc.climb.stance import FREE_LIMB
from wbc.climb.world import ClimbWorld, held_pose
from wbc.errors import RangeError, ShapeError
from wbc.multibody import pin
from wbc.symbolic.joint_steps import place
from wbc.symbolic.kinematics import frame_index
from wbc.validation import Array

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
        friction: share of the coefficients of friction, and of soles, that counts [1].

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
        poses = self._poses(held, at)
        if motors:
            return self._with_motors(held, at, poses, effort, np.inf)
        return self.world.slack(self.world.places_of(held), self.climber.center_of_mass(at), poses)[0]

    def driven(self, contacts: Sequence[int], q: Array, least: float, effort: float = 1.0) -> bool:
        """Whether :meth:`margin` with motors is at least ``least``: without a program where the least forces show it.

        Args:
            contacts, q, effort: as of :meth:`margin`. least: in shares of the weight [1].

        Raises:
            ShapeError, RangeError: contacts that are none.
        """
        held = self._checked(contacts)
        return self._with_motors(held, q, self._poses(held, q), effort, least) >= least

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
        if self.driven(held, q, 0.0, effort):
            return []
        G, r, A, _, b, motors = self._motors_program(held, q, self._poses(held, q), effort)
        cones, limits = len(A) - 2 * len(motors), self.climber.robot.limits.effort[motors] / weight
        sizes = np.concatenate([np.ones(cones), limits, limits])
        # What no wrench of these contacts balances at all is the contacts' as well
        base = np.vstack([np.eye(6), -np.eye(6)]).T
        rows, count = np.hstack([A, -np.diag(sizes), np.zeros((len(A), 12))]), G.shape[1]
        cost = np.concatenate([np.zeros(count), np.ones(len(A)), np.full(12, UNBALANCED)])
        free = [(None, None)] * count + [(0.0, None)] * (len(A) + 12)
        answer = linprog(cost, rows, b, np.hstack([G, np.zeros((6, len(A))), base]), r, free, method="highs")
        over = answer.x[count : count + len(A)] * sizes
        names = [self.climber.robot.dof_names[dof] for dof in motors]
        both = np.maximum(over[cones : cones + len(motors)], over[cones + len(motors) :]) * weight
        lacks = [("contacts", float(over[:cones].max(initial=0.0) + answer.x[count + len(A) :].sum()))]
        lacks += sorted(zip(names, both.tolist(), strict=True), key=lambda lack: -lack[1])
        return [(name, amount) for name, amount in lacks if amount > COUNTS]

    def wrench_slacks(self, contacts: Sequence[int], q: Array, point: Array, wrenches: Array) -> tuple[Array, Array]:
        """Slacks of contacts, turned as in a configuration, for wrenches that they have to give, and their bounds: as
        of :meth:`ClimbWorld.wrench_slacks`.

        Raises:
            ShapeError, RangeError: contacts that are none.
        """
        held = self._checked(contacts)
        return self.world.wrench_slacks(self.world.places_of(held), self._poses(held, q), point, wrenches)

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

    def _program(self, held: tuple[int, ...], poses: Array, center: Array) -> tuple[Array, Array, Array, Array, Array]:
        """G, r, A, s and b of G x = r and A x + s t <= b, in weights; moments about the centre."""
        weight, gravity = self.world.weight, np.asarray(self.scene.gravity)
        maps, blocks, slacks, sides = [], [], [], []
        for limb, at in enumerate(self.world.places_of(held)):
            if at < 0:
                continue
            cone = self.world.cone(limb, at)
            turn, arm = poses[limb, :9].reshape(3, 3), poses[limb, 9:] - center
            force, moment = turn @ cone.N[:3], turn @ cone.N[3:]
            maps.append(np.vstack([force, moment + np.cross(arm, force, axisb=0, axisc=0)]))
            blocks.append(cone.A)
            slacks.append(cone.s)
            sides.append(cone.b / weight)
        G = np.hstack(maps) if maps else np.zeros((6, 0))
        A = np.zeros((sum(map(len, blocks)), G.shape[1]))
        row, column = 0, 0
        for block in blocks:
            A[row : row + block.shape[0], column : column + block.shape[1]] = block
            row, column = row + block.shape[0], column + block.shape[1]
        r = np.concatenate([-gravity * self.climber.mass / weight, np.zeros(3)])
        return G, r, A, np.concatenate([*slacks, []]), np.concatenate([*sides, []])

    def _with_motors(self, held: tuple[int, ...], q: Array, poses: Array, effort: float, enough: float) -> float:
        """The slack with torques of motors within their efforts, which take no part in it; ``enough``, where the least
        forces have that.
        """
        G, r, sides, slacks, ends, _ = self._motors_program(held, q, poses, effort)
        if np.linalg.matrix_rank(G) < 6:
            return -np.inf
        sides = np.hstack([sides, slacks[:, None]])
        if enough < np.inf and (sides @ [*np.linalg.lstsq(G, r)[0], enough] <= ends).all():
            return enough
        free = [(None, None)] * G.shape[1] + [(None, 1.0)]
        cost = np.concatenate([np.zeros(G.shape[1]), [-1.0]])
        answer = linprog(cost, sides, ends, np.hstack([G, np.zeros((6, 1))]), r, free, method="highs")
        if answer.status != 0:
            return -np.inf
        slack = float(answer.x[-1])
        return slack if not self.world.numbers.weightless else (np.inf if slack > 0.0 else -np.inf)

    def _motors_program(
        self, held: tuple[int, ...], q: Array, poses: Array, effort: float
    ) -> tuple[Array, Array, Array, Array, Array, list[int]]:
        """G, r, A, s and b as of :meth:`_program`, with a row for each sign of the torque of the motors at last."""
        robot, weight = self.climber.robot, self.world.weight
        model, data = robot.model, robot.model.createData()
        G, r, A, s, b = self._program(held, poses, self.climber.center_of_mass(q))
        pin.computeJointJacobians(model, data, q)
        own = (
            -(self.climber.mass * pin.jacobianCenterOfMass(model, data, q)).T @ np.asarray(self.scene.gravity) / weight
        )
        pulled = [np.zeros((model.nv, 0))]
        for limb, at in enumerate(self.world.places_of(held)):
            if at >= 0:
                cone, turn = self.world.cone(limb, at), poses[limb, :9].reshape(3, 3)
                frame = frame_index(model, self.climber.limbs[limb].frame)
                pin.updateFramePlacement(model, data, frame)
                J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
                arm = poses[limb, 9:] - data.oMf[frame].translation
                force, moment = turn @ cone.N[:3], turn @ cone.N[3:]
                pulled.append(J.T @ np.vstack([force, moment + np.cross(arm, force, axisb=0, axisc=0)]))
        motors = [dof for dof in robot.motors if np.isfinite(robot.limits.effort[dof])]
        torque, most = -np.hstack(pulled)[motors], effort * robot.limits.effort[motors] / weight
        sides, slacks = np.vstack([A, torque, -torque]), np.concatenate([s, np.zeros(2 * len(motors))])
        return G, r, sides, slacks, np.concatenate([b, most - own[motors], most + own[motors]]), motors
