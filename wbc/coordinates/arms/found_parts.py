"""Parts of any arm, found in the robot's tree and by the ranks of its Jacobians at random configurations."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, islice

import numpy as np

from wbc.analysis.rows import BodyRows, PitchPlaneRows
from wbc.coordinates.arms.arm_parts import Arm, Held, Parts, components
from wbc.coordinates.arms.constraint_sets import SUBSETS, Sampled, sets_of, single_sets
from wbc.coordinates.arms.tree import Chain, chains_of, single
from wbc.coordinates.rows import AxisRows, Coordinate, PlaneAngleRows
from wbc.coordinates.samples import ROUNDING, rank, states_of
from wbc.errors import WbcError
from wbc.multibody import pin
from wbc.robot import Robot
from wbc.symbolic.kinematics import WORLD, frame_index
from wbc.tasks._stereographic import triple
from wbc.validation import Array

#: Configurations at which ranks are looked at
PART_STATES = 16


def found_parts(robot: Robot) -> Parts:
    """What operators command of a robot that says nothing about itself but its tree of joints.

    * **Arms** are chains of joints, see :func:`wbc.coordinates.arms.tree.chains_of`.
    * **Tip**: its pose where six rows are independent; else its position, or the coordinates of it that are.
    * **Middle**: the origin of the joint that is nearest to half of the arm's length, on the body before it.
    * **Plane**: the pitch plane alpha where three joints in a row have parallel axes and another one turns them; else
      the angle psi of shoulder, elbow and wrist.
    * **Sets** of what is held: those of alpha or psi, beta, gamma, locks and the middle point's coordinates that
      complete the tip's rows, see :mod:`wbc.coordinates.arms.constraint_sets`.

    Raises:
        MissingPartError: no arm, one whose base floats, or with joints that do not move by themselves.
    """
    chains = chains_of(robot)
    for chain in chains.arms:
        single(robot, chain.joints)
    finder = _PartFinder(robot)
    drafts = [finder.draft(chain) for chain in chains.arms]
    names = [str(n) for n in robot.model.names]
    trunk = chains.trunk
    carrier = None
    if len(trunk) >= 6 and all(int(robot.model.nvs[j]) == 1 for j in trunk):
        draft = finder.draft(Chain("carrier_", trunk, ""))
        carrier = draft if draft.redundancy >= 0 and draft.tip.rotation else None
    whole = finder.robot
    arms = tuple(_with_sets(whole, draft) for draft in drafts)
    body = names[trunk[0]] if len(trunk) == 1 else None
    idle = [] if carrier is not None or body is not None else list(trunk)
    others = tuple(names[j] for j in sorted((*idle, *chains.others)))
    return Parts(whole, arms, body, None if carrier is None else _with_sets(whole, carrier), others)


class _PartFinder:
    """Frames that parts need are added to the robot as they are found."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self._states = states_of(robot, PART_STATES)
        self._data = robot.model.createData()

    def draft(self, chain: Chain) -> Arm:
        """An arm without its sets."""
        robot, joints, prefix = self.robot, chain.joints, chain.prefix
        names = tuple(str(robot.model.names[j]) for j in joints)
        end = chain.tip or self._frame(f"{prefix}tip", joints[-1], pin.SE3.Identity())
        tip = self._tip(prefix, end, joints)
        k, middle = self._middle(prefix, end, joints)
        plane: PitchPlaneRows | PlaneAngleRows | None
        plane, in_plane = self._pitch_plane(prefix, joints)
        if plane is None and middle is not None:
            plane = self._three_points(prefix, joints, middle.frame, end)
        return Arm(prefix, names, tip, middle, k, plane, in_plane, (), (), None, ())

    def _frame(self, name: str, joint: int, place: pin.SE3) -> str:
        """A new frame on a joint's body; its name is made new, too."""
        taken = self.robot.frame_names
        name = next(n for n in (name, *(f"{name}_{k}" for k in range(2, len(taken) + 3))) if n not in taken)
        model = pin.Model(self.robot.model)
        model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME))
        self.robot = replace(self.robot, model=model)
        self._data = model.createData()
        return name

    def _jacobians(self, frame: str, joints: tuple[int, ...]) -> Array:
        """(v / length; omega) of a frame by the rates of some joints, in the world's axes [states, 6, joints]."""
        model, index = self.robot.model, frame_index(self.robot.model, frame)
        columns = [int(model.idx_vs[j]) for j in joints]
        out = np.empty((len(self._states), 6, len(joints)))
        for n, q in enumerate(self._states):
            J = pin.computeFrameJacobian(model, self._data, q, index, pin.LOCAL_WORLD_ALIGNED)
            out[n] = J[:, columns]
        slides = np.array([self.robot.dof_units[c] == "m" for c in columns])
        length = self.robot.characteristic_length
        out[:, :3] /= length
        return out * np.where(slides, length, 1.0)

    def _tip(self, prefix: str, frame: str, joints: tuple[int, ...]) -> BodyRows:
        J = self._jacobians(frame, joints)
        if rank(J) == 6:
            return BodyRows(frame, name=f"{prefix}pose")
        moved, turned = rank(J[:, :3]), rank(J[:, 3:])
        if moved:
            return _independent(frame, f"{prefix}tip", J[:, :3], moved)
        return _independent(frame, f"{prefix}tip", J[:, 3:], turned, rotation=True)

    def _middle(self, prefix: str, end: str, joints: tuple[int, ...]) -> tuple[int, BodyRows | None]:
        """(joints before it, the middle point)."""
        model = self.robot.model
        steps = [float(np.linalg.norm(model.jointPlacements[j].translation)) for j in joints[1:]]
        last = model.frames[frame_index(model, end)].placement.translation
        along = np.cumsum(steps)
        half = 0.5 * float((along[-1] if steps else 0.0) + np.linalg.norm(last))
        order = sorted(range(1, len(joints)), key=lambda k: (abs(along[k - 1] - half), -k))
        name = f"{prefix}{'elbow' if len(joints) > 3 else 'middle'}"
        best: tuple[int, int] | None = None
        for k in order:
            trial = pin.Frame(name, joints[k - 1], 0, model.jointPlacements[joints[k]], pin.FrameType.OP_FRAME)
            found = rank(self._point(trial, joints[:k])[:, :3])
            if found and (best is None or (found > best[1] and best[1] < 2)):
                best = k, found
        if best is None:
            return 0, None
        k, count = best
        frame = self._frame(name, joints[k - 1], model.jointPlacements[joints[k]])
        J = self._jacobians(frame, joints[:k])[:, :3]
        ever = [i for i in range(3) if np.abs(J[:, i]).max() > ROUNDING]
        if len(ever) == 3 and count < k:
            return k, BodyRows(frame, rotation=(), name=name)
        return k, _independent(frame, name, J, min(count, k))

    def _point(self, frame: pin.Frame, joints: tuple[int, ...]) -> Array:
        """Jacobians of a frame that the robot does not have."""
        before = self.robot, self._data
        try:
            return self._jacobians(self._frame(str(frame.name), int(frame.parentJoint), frame.placement), joints)
        finally:
            self.robot, self._data = before

    def _pitch_plane(self, prefix: str, joints: tuple[int, ...]) -> tuple[PitchPlaneRows | None, Held]:
        """alpha, and beta and gamma, of the first three turning joints in a row with parallel axes that are carried."""
        model = self.robot.model
        axes = [_axis(self.robot, j) for j in joints]
        for i in range(1, len(joints) - 2):
            one, two, three = axes[i : i + 3]
            if one is None or two is None or three is None or all(a is None for a in axes[:i]):
                continue
            # An axis does not move under the turn about itself: parallel in one configuration, parallel in all
            turn = np.array(model.jointPlacements[joints[i + 1]].rotation)
            further = turn @ model.jointPlacements[joints[i + 2]].rotation
            away = [np.cross(one, turn @ two), np.cross(one, further @ three)]
            if np.linalg.norm(away) > ROUNDING:
                continue
            shoulder = self._frame(f"{prefix}shoulder", joints[i], pin.SE3.Identity())
            wrist = self._frame(f"{prefix}wrist", joints[i + 2], pin.SE3.Identity())
            held: list[Coordinate] = []
            if i >= 2:
                upper = self._frame(f"{prefix}shoulder_body", joints[i - 1], pin.SE3.Identity())
                held.append(AxisRows(upper, triple(one), shoulder, name=f"{prefix}beta"))
            if i + 3 < len(joints):
                hand = self._frame(f"{prefix}wrist_body", joints[i + 3], pin.SE3.Identity())
                held.append(AxisRows(hand, triple(three), wrist, name=f"{prefix}gamma"))
            return PitchPlaneRows(shoulder, wrist, name=f"{prefix}alpha"), tuple(held)
        return None, ()

    def _three_points(self, prefix: str, joints: tuple[int, ...], elbow: str, end: str) -> PlaneAngleRows | None:
        """The angle of shoulder, elbow and wrist, where these are three points that joints move."""
        if len(joints) < 4:
            return None
        roles = self.robot.frames
        shoulder = roles.get("shoulder") if not prefix else roles.get(f"{prefix}shoulder")
        wrist = roles.get("wrist") if not prefix else roles.get(f"{prefix}wrist")
        before = self.robot, self._data
        shoulder = shoulder or self._frame(f"{prefix}shoulder", joints[1], pin.SE3.Identity())
        if wrist is None:
            wrist = self._frame(f"{prefix}wrist", joints[-2], pin.SE3.Identity()) if len(joints) > 5 else end
        angle = PlaneAngleRows(shoulder, elbow, wrist, name=f"{prefix}psi")
        try:
            angle.task.validate(self.robot)
        except WbcError:
            self.robot, self._data = before
            return None
        if not self._spans(shoulder, elbow, wrist):
            self.robot, self._data = before
            return None
        return angle

    def _spans(self, *frames: str) -> bool:
        """Three points are not on a line at some configuration."""
        model = self.robot.model
        indices = [frame_index(model, name) for name in frames]
        wide = 0.0
        for q in self._states:
            pin.framesForwardKinematics(model, self._data, q)
            s, e, w = (self._data.oMf[i].translation for i in indices)
            wide = max(wide, float(np.linalg.norm(np.cross(e - s, w - s))) / self.robot.characteristic_length**2)
        return wide > 1e-4


def _with_sets(robot: Robot, arm: Arm) -> Arm:
    """An arm with what is held."""
    plane = () if arm.plane is None else (arm.plane,)
    pool = (*plane, *arm.in_plane, *arm.locks())
    points = components(arm.middle) if arm.middle is not None else ()
    whole = () if arm.middle is None else (arm.middle,)
    sampled = Sampled(robot, arm.joints, (arm.tip, *pool, *points, *whole))
    spare = arm.redundancy
    if spare == 0:
        sets: tuple[Held, ...] = ((),)
    elif spare == 1:
        few = (*plane, *arm.in_plane, *(arm.locks()[k] for k in dict.fromkeys((0, 1, len(arm.joints) - 1))), *points)
        sets = single_sets(sampled, arm.tip, few) or single_sets(sampled, arm.tip, pool)
    else:
        sets = sets_of(sampled, arm.tip, pool, spare)
    arm = replace(arm, sets=sets)
    return replace(
        arm,
        with_middle=_with_middle(robot, arm, pool),
        with_both=_with_both(sampled, arm, pool),
        position_sets=_position_sets(robot, arm, pool),
    )


def _with_middle(robot: Robot, arm: Arm, pool: Held) -> Held:
    """What is held besides the joints beyond the middle point, one coordinate after another while the rank grows."""
    if arm.middle is None:
        return ()
    before = arm.joints[: arm.before_middle]
    sampled = Sampled(robot, before, (arm.middle, *pool))
    held: Held = ()
    count = rank(sampled.stacked((arm.middle,)))
    for one in pool:
        if count == len(before):
            break
        more = rank(sampled.stacked((arm.middle, *held, one)))
        if more > count:
            held, count = (*held, one), more
    return held


def _with_both(sampled: Sampled, arm: Arm, pool: Held) -> Held | None:
    """What is held besides the tip so that the middle point has more rows than there are motions left, and tells all
    of these; None where it tells nothing of self-motion.
    """
    if arm.middle is None or not arm.redundancy:
        return None
    rows = len(arm.middle.translation)
    for count in range(max(0, arm.redundancy + 1 - rows), arm.redundancy):
        # Locks of the last joints first: they leave the point its motion
        for held in islice(combinations(reversed(pool), count), SUBSETS):
            left = rank(sampled.stacked((arm.tip, *held)))
            if left == len(arm.joints) - arm.redundancy + count and sampled.completes(arm.middle, (arm.tip, *held)):
                return held
    return None


def _position_sets(robot: Robot, arm: Arm, pool: Held) -> tuple[Held, ...]:
    """What is held while the position of a tip with a pose is commanded: the wrist and one more, or what completes."""
    if not (arm.tip.rotation and arm.tip.translation):
        return ()
    point = BodyRows(arm.tip.frame, rotation=())
    sampled = Sampled(robot, arm.joints, (point, *pool))
    spare = len(arm.joints) - 3
    wrist = arm.locks(min(4, spare))
    more = [one for one in pool if one not in wrist]
    wanted = [tuple(wrist)] if len(wrist) == spare else [(one, *wrist) for one in more if len(wrist) + 1 == spare]
    found = tuple(held for held in wanted if sampled.completes(point, held))
    return found or sets_of(sampled, point, pool, spare)


def _independent(frame: str, name: str, J: Array, count: int, *, rotation: bool = False) -> BodyRows:
    """The ``count`` components along the world's axes that are the farthest from depending on each other."""
    chosen = max(
        combinations(range(3), count),
        key=lambda some: float(np.median(np.linalg.svd(J[:, list(some)], compute_uv=False)[:, -1])),
    )
    moved, turned = ((), chosen) if rotation else (chosen, ())
    whole = None if count == 3 else WORLD
    return BodyRows(frame, expressed=whole, translation=moved, rotation=turned, name=name)


def _axis(robot: Robot, joint: int) -> Array | None:
    """Axis of a turning joint in its own frame; None for one that slides."""
    data = robot.model.createData()
    pin.computeJointJacobians(robot.model, data, robot.neutral)
    column = pin.getJointJacobian(robot.model, data, joint, pin.LOCAL)[3:, robot.model.idx_vs[joint]]
    size = float(np.linalg.norm(column))
    return None if size < ROUNDING else np.asarray(column / size)
