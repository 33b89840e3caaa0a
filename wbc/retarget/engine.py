"""The stack that brings a robot to targets, and its ticks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wbc import robots, tasks
from wbc.api import Controller, Stack
from wbc.controller.compiled_stack import core_of
from wbc.controller.handle import InputGroup
from wbc.controller.row_ticks import RowTicks
from wbc.multibody import pin
from wbc.retarget.clip import Array
from wbc.retarget.options import RetargetOptions
from wbc.retarget.plan import ContactGrip, MotionPlan, balanced, logarithms
from wbc.retarget.robot_body import RobotBody, with_frame
from wbc.robot import Robot
from wbc.shapes import Convex, HalfSpace, PlacedShape
from wbc.tasks.base import Task
from wbc.tick.outcome import Status

#: Gain of tasks, as share of one over the time of a tick
GAIN = 0.5
#: Gain of tasks at most: what is far off comes back without swinging the robot about [1/s]
FASTEST = 15.0
#: What links that come nearer to each other, or to the ground, than their clearance cost
CLEARANCE_PRICE = 1e4
#: How many pairs of links have rows at a time
CLOSEST = 10
#: Links with so many joints between them and fewer may touch: hulls of links stand out of them near their joints
NEIGHBOURS = 3
#: Random configurations of which pairs of links that can touch are found
PAIR_SAMPLES = 2000
#: Corners of the hull of a link besides feet and hands, at most: more than have rows of their own, so that they are
#: measured before a tick, which is faster
LINK_CORNERS = 500
#: Fewer do where they are within this of it [m]
NEAR_ENOUGH = 1e-5
#: Half the thickness of what is drawn as a plane [m]
THIN = 2e-4
#: Links besides feet that have rows of the ground at a time; of arms two a limb more
NEAREST = 4
#: The ground's rows begin this far above it: paths are curved [m]
ABOVE = 3e-4
#: Those of arms, which roll and lower another corner within a tick [m]
ARMS_ABOVE = 1e-3
#: What a foot that goes below the ground costs, see docs/soft.md
GROUND_PRICE = 1e5
#: Item whose rows keep hands and arms above the ground
ARMS = "arms above ground"
#: How fast links come down to the ground's rows, as share of one over the time of a tick
GROUND_RATE = 0.5
#: A foot whose stance is younger than this gives way to those that stand [s]
LANDING = 0.1
#: After so many ticks it is tried again
AGAIN = 3
#: Iterations after which a tick with such a foot has no answer: those that have one take a quarter, and finding by how
#: much rows give way takes ten times as long
TRIED = 200
#: Distance from a sole's middle at which its turns are counted [m]
LEVER = 0.12
#: A foot is held from where it is this near to its place [m]
FOOT_ENGAGED = 3e-3
#: A hand, which its task draws less [m]
HAND_ENGAGED = 3e-2
#: How much more the height of a hand that lies on the ground counts than that of one in the air [1]
LYING = 1e2
#: Rows of the ground that give way by more ask hands to rise [m/s]
PUSHED = 0.02
#: Ticks that bring the robot to the first frame
SETTLING = 80
#: How far contacts that are held at first may lead the trunk from where it is without them [m]
LED_AWAY = 0.1
#: The first frame is reached when no joint moves faster [rad/s]
SETTLED = 1e-3


def limited(robot: Robot, options: RetargetOptions) -> Robot:
    """A robot with limits of velocity and acceleration for every joint, the base included: the description's where it
    has one, else the options'.
    """
    limits, base = robot.limits, robot.base_nv
    velocity = np.where(np.isfinite(limits.velocity), limits.velocity, options.velocity)
    acceleration = np.where(np.isfinite(limits.acceleration), limits.acceleration, options.acceleration)
    velocity[:base], acceleration[:base] = options.base_velocity, options.base_acceleration
    return robot.with_limits(velocity=velocity, acceleration=acceleration)


@dataclass(frozen=True)
class StillContact(tasks.Hold):
    """A contact at rest; where its target is after a tick is met to rounding, second-order motion included."""

    abstract: ClassVar[bool] = True
    exact: ClassVar[bool] = True


class _PlanFollower(NamedTuple):
    """An item that follows a position and a rotation of the plan, "" where none; at the next ones, if it stands."""

    item: str
    place: str = ""
    turn: str = ""
    stands: bool = False


class Engine:
    """The compiled stack of a robot that follows a plan, tick by tick.

    Attributes:
        robot: with its limits. controller: of the stack.
    """

    def __init__(
        self, body: RobotBody, followed: Sequence[str], options: RetargetOptions, dt: float, *, head: bool = False
    ) -> None:
        self.body, self.options, self.dt = body, options, dt
        self.robot = self._shaped(limited(body.robot, options))
        self._limbs = [name for name in body.limbs if name in followed]
        weights = options.weights
        self._stack = stack = Stack(self.robot, dt=dt, calm=False)
        self._followers: list[_PlanFollower] = []
        gain = min(GAIN / dt, FASTEST)
        free = self.robot.base != "fixed"
        self._holds = free and options.hold
        if free:
            six = (weights.pelvis,) * 3 + (weights.turn,) * 3
            self._follow("pelvis", tasks.EndEffector(body.pelvis, weights=six, gain=gain), "pelvis", "pelvis")
        chest = body.chest if body.plan.upright and body.plan.chest != body.plan.pelvis else ""
        for name, frame, weight in (("chest", chest, weights.chest), ("head", body.head if head else "", weights.head)):
            if frame:
                self._follow(name, tasks.EndEffector(frame, "orientation", gain=gain), turn=name, weight=weight)
        if options.balance and free:
            # Over the contacts, wherever their height
            mass = tasks.CenterOfMass(weights=(1.0, 1.0, 0.0), gain=gain)
            self._follow("balance", mass, "balance", weight=options.balance)
        for name in self._limbs:
            self._add_limb(name, gain)
        followers = self._followers
        stack.add(tasks.Posture(start="neutral", gain=1.0), name="posture", weight=weights.posture)
        stack.add(tasks.JointLimits(shortest_dt=dt), name="limits")
        if options.clearance is not None:
            clear = tasks.SelfCollision(margin=options.clearance, closest=CLOSEST, method="sensed")
            stack.add(clear, name="clearance", soft=CLEARANCE_PRICE)
        self._ground: list[str] = []
        if free:
            self._add_ground()
        self.controller: Controller = stack.compile()
        for item in self._ground:
            self.controller[item].rate = GROUND_RATE / dt
        inputs = [(f.item, part, None) for f in followers for part in ("target", "feedforward")[: 1 if f.stands else 2]]
        self._ticks = RowTicks(self.controller, inputs, ARMS if ARMS in self._ground else "")
        self._places = tuple(dict.fromkeys(("pelvis", *(f.place for f in followers if f.place))))
        self._turns = tuple(dict.fromkeys(("pelvis", "", *(f.turn for f in followers))))
        self._order = self._order_of()
        self._held: dict[str, ContactGrip] = {}
        self._data = self.robot.model.createData()
        if free:
            #: the root as seen from the pelvis, where the robot is as at rest
            neutral = body.robot.neutral
            self._root = body.robot.pose(neutral, body.pelvis).inverse() * pin.XYZQUATToSE3(neutral[:7])
        self._ends = {name: int(self.robot.model.getFrameId(body.limbs[name].end)) for name in self._limbs}
        tasks_there = [entry.name for entry in stack.entries if isinstance(entry.item, Task)]
        self._gains = InputGroup(core_of(self.controller), [(item, "gain", None) for item in tasks_there])
        self._own_gains = np.array([self.controller[item].gain for item in tasks_there])

    def _shaped(self, robot: Robot) -> Robot:
        """The robot with balls around what it may touch the ground with, and where clearances are asked for with shapes
        on all links.
        """
        pairs = robot.self_pairs
        if self.options.clearance is not None:
            robot = robots.fit_shapes(robot)
            found = robots.find_self_pairs(robot, samples=PAIR_SAMPLES).kept
            pairs = tuple(pair for pair in found if _joints_between(robot, *pair) > NEIGHBOURS)
        limbs, shapes = self.body.limbs, dict[str, list[PlacedShape]]()
        #: frames of links besides ends: of arms, and of all others
        self._arms, self._links = list[str](), list[str]()
        last = {limb.joints[-1] for limb in limbs.values()}
        of_arms = {joint for name, limb in limbs.items() if not self.body.is_foot(name) for joint in limb.joints}
        for name, limb in limbs.items():
            ball = np.linalg.norm(limb.surface, axis=1) <= limb.radius + NEAR_ENOUGH
            if not self.body.is_foot(name) or limb.contact == "flat" or ball.all() or not ball.any():
                shapes[limb.end] = [_solid(limb.surface)]
                continue
            # A point foot's ball is off the ground however its leg turns, what is above the ball is not
            end, frame = robot.model.frames[robot.model.getFrameId(limb.end)], f"retarget_ground_{name}"
            robot = with_frame(robot, frame, int(end.parentJoint), end.placement)
            shapes |= {limb.end: [_solid(limb.surface[ball])], frame: [_solid(limb.surface[~ball])]}
            self._links.append(frame)
        for joint, balls in self.body.balls.items() if robot.base != "fixed" else ():
            if joint not in last:
                frame = f"retarget_ground_{joint}"
                robot = with_frame(robot, frame, joint, pin.SE3.Identity())
                shapes[frame] = [_solid(balls.corners(LINK_CORNERS, NEAR_ENOUGH))]
                (self._arms if joint in of_arms else self._links).append(frame)
        return robot.with_shapes({**robot.shapes, **shapes}).with_self_pairs(pairs)

    def _add_ground(self) -> None:
        """Rows of the ground: of each foot, which end while it is held, of hands and arms, and of other links.

        A foot that is held comes down to its place on the ground as fast as the plan says. A row that lets it come down
        slower would be served by turns of its leg, which lift corners of its hull.
        """
        ends, feet = {name: limb.end for name, limb in self.body.limbs.items()}, filter(self.body.is_foot, self._limbs)
        self._own_ground = {name: f"{name} above ground" for name in feet if self.options.hold}
        groups = {item: [ends.pop(name)] for name, item in self._own_ground.items()}
        arms = [ends.pop(name) for name in [*ends] if not self.body.is_foot(name)] + self._arms
        groups |= {"above ground": [*ends.values(), *self._links], ARMS: arms}
        for item, links in groups.items():
            if links:
                pose = pin.SE3(np.eye(3), np.array([0.0, 0.0, ARMS_ABOVE if item == ARMS else ABOVE]))
                closest = NEAREST + 2 * len(self.body.limbs) * (item == ARMS)
                ground = tasks.Obstacle(HalfSpace(), links=tuple(links), pose=pose, closest=closest)
                self._stack.add(ground, name=item, soft=GROUND_PRICE)
                self._ground.append(item)

    def _follow(self, item: str, task: Task, place: str = "", turn: str = "", weight: float = 1.0) -> None:
        """Add a task that follows a position, a rotation or both of the plan."""
        self._stack.add(task, name=item, weight=weight)
        self._followers.append(_PlanFollower(item, place, turn))

    def _add_limb(self, name: str, gain: float) -> None:
        """Add what follows a limb's targets."""
        body, weights, limb = self.body, self.options.weights, self.body.limbs[name]
        flat, foot = limb.contact == "flat", self.body.is_foot(name)
        points = [(f"{name} middle", limb.middle, weights.middle)] if body.plan.upright else []
        if not foot:
            points += [(f"{name} wrist", limb.wrist, weights.wrist), (name, limb.end, 0.1 * weights.wrist)]
        elif not flat:
            points.append((name, limb.end, weights.foot))
        for item, frame, weight in points:
            if frame:
                self._follow(item, tasks.EndEffector(frame, "position", gain=gain), item, weight=weight)
        if foot and flat:
            six = (weights.foot,) * 3 + (weights.sole,) * 3
            self._follow(name, tasks.EndEffector(limb.end, weights=six, gain=gain), name, name)
        if self._holds:
            contact = StillContact(limb.end, "pose" if flat else "position", gain=1.0 / self.dt)
            self._stack.add(contact, name=f"{name} stands")
            self._followers.append(_PlanFollower(f"{name} stands", name, name if flat else "", stands=True))

    def _order_of(self) -> NDArray[np.int_]:
        """Which of the numbers of :meth:`rows`, before they are put in order, each item's inputs are."""
        turns, places = len(self._turns), len(self._places)
        blocks = np.split(np.arange(21 * turns + 9 * places), np.cumsum([18 * turns, 6 * places, 3 * places]))
        targets, points = blocks[0].reshape(2, turns, 9), blocks[1].reshape(2, places, 3)
        rates, spins = blocks[2].reshape(places, 3), blocks[3].reshape(turns, 3)
        order = []
        for follower in self._followers:
            ahead, place = int(follower.stands), [self._places.index(follower.place)] if follower.place else []
            turn = [self._turns.index(follower.turn)] if follower.turn or ahead else []
            order += [targets[ahead, turn], points[ahead, place], *(() if ahead else (rates[place], spins[turn]))]
        return np.concatenate([columns.ravel() for columns in order])

    def targets(self, plan: MotionPlan) -> tuple[Array, Array]:
        """Positions [ticks, places, 3] and rotations [ticks, turns, 3, 3] that the stack follows."""
        places = {"pelvis": plan.pelvis}
        turns = {"pelvis": plan.turn, "chest": plan.chest, "": np.broadcast_to(np.eye(3), (plan.ticks, 3, 3))}
        if plan.head is not None:
            turns["head"] = plan.head
        if "balance" in self._places:
            places["balance"] = balanced(plan)
        for name in self._limbs:
            limb = plan.limbs[name]
            places |= {f"{name} middle": limb.middle, f"{name} wrist": limb.wrist, name: limb.end}
            if limb.rotation is not None:
                turns[name] = limb.rotation
        return np.stack([places[name] for name in self._places], 1), np.stack([turns[name] for name in self._turns], 1)

    def rows(self, places: Array, turns: Array) -> Array:
        """Numbers of all inputs over ticks [ticks, numbers], of :meth:`targets`."""
        ticks, dt = len(places), self.dt
        next_places, next_turns = _next(places), _next(turns)
        steps = next_turns @ np.swapaxes(turns, -1, -2)
        numbers = (
            np.swapaxes(turns, -1, -2), np.swapaxes(next_turns, -1, -2), places, next_places,
            (next_places - places) / dt, logarithms(steps.reshape(-1, 3, 3)) / dt,
        )  # fmt: skip
        return np.take(np.concatenate([values.reshape(ticks, -1) for values in numbers], axis=1), self._order, axis=1)

    def start(self, places: Array, turns: Array, held: Mapping[str, ContactGrip]) -> Array:
        """Bring the robot to the first of some targets, with the velocity with which they go on; its configuration.

        Args:
            held: limb -> how its contact is held at first.
        """
        robot, controller = self.robot, self.controller
        q = robot.neutral.copy()
        if robot.base != "fixed":
            q[:7] = pin.SE3ToXYZQUAT(pin.SE3(turns[0, 0], places[0, 0]) * self._root)
            q[3:7] /= np.linalg.norm(q[3:7])
        first, second = (self.rows(places[[k]], turns[[k]])[0] for k in (0, min(1, len(places) - 1)))
        self._hold(dict.fromkeys(self._limbs, ContactGrip.FREE))
        fast = np.full(len(self._own_gains), GAIN / self.dt)
        self._gains.write(fast)
        q, _ = self._settled(q, first, SETTLING)
        # What is held jumps to its place, so it is brought there before; what cannot be there, or leads the trunk away
        # as it goes there, is not held
        self._hold(held)
        placed, served = self._settled(q, first, SETTLING // 4)
        served &= not self._holds or float(np.linalg.norm(placed[:3] - q[:3])) < LED_AWAY
        if not served:
            # With gains of their own tasks push feet less into the ground
            self._hold(dict.fromkeys(self._limbs, ContactGrip.FREE))
            self._gains.write(self._own_gains)
            placed, _ = self._settled(q, first, SETTLING // 4)
            self._gains.write(fast)
        q = placed
        after, _ = self._settled(q, second, SETTLING // 4)
        self._gains.write(self._own_gains)
        v = pin.difference(robot.model, q, after) / self.dt
        limit = robot.limits.velocity
        controller.reset(q, np.clip(v, -limit, limit))
        return q

    def _settled(self, q: Array, row: Array, most: int) -> tuple[Array, bool]:
        """Where ticks with the same inputs lead, and whether nothing gives way there."""
        self.controller.reset(q)
        self._ticks.most, self._ticks.rest = np.inf, SETTLED
        rows, out = np.tile(row, (most, 1)), np.empty((most + 1, len(q)))
        out[0] = q
        done, served = self._ran(rows, out)
        self._ticks.rest = 0.0
        return np.asarray(out[done]), served

    def _ran(self, rows: Array, q: Array) -> tuple[int, bool]:
        """Ticks of some rows, whatever gives way: how many were done before all was at rest, and whether the last is
        one in which nothing gives way.
        """
        done = 0
        while done < len(rows):
            count, step = self._ticks.run(rows[done:], q[done:])
            done += count
            if step is None:
                return done, True
            q[done + 1], done = step.q_next, done + 1
        return done, False

    def _hold(self, wanted: Mapping[str, ContactGrip]) -> None:
        """Hold contacts, or let them go."""
        for name, grip in wanted.items() if self._holds else ():
            if self._held.get(name) is not grip:
                contact = self.controller[f"{name} stands"]
                if name in self._own_ground:
                    self.controller[self._own_ground[name]].enabled = grip is ContactGrip.FREE
                else:
                    # The hull of a hand that lies on the ground may ask it to be higher, by the rows of the ground
                    contact.mask = (1.0, 1.0, float(grip is ContactGrip.FIRM))
                    self.controller[name].mask = (1.0, 1.0, LYING if grip is ContactGrip.LEVEL else 1.0)
                contact.enabled = grip is not ContactGrip.FREE
                self._held[name] = grip

    def run(self, plan: MotionPlan) -> tuple[Array, list[tuple[int, tuple[str, ...]]]]:
        """All ticks of a plan.

        Returns:
            Configurations [ticks, nq], and the ticks at which rows gave way with the names of their items.
        """
        places, turns = self.targets(plan)
        rows = self.rows(places, turns)
        q = self.start(places, turns, {name: plan.limbs[name].grip(0) for name in self._limbs})
        out = np.empty((plan.ticks, self.robot.nq))
        out[0] = q
        limbs = [plan.limbs[name] for name in self._limbs]
        marks = np.array([mark for limb in limbs for mark in (limb.held, limb.lies)]).T
        changing = np.flatnonzero(np.concatenate([[True], (marks[1:] != marks[:-1]).any(axis=1)]))
        #: limb -> the first tick in which it may be held again, and the tick from which it is held
        not_before, since = dict.fromkeys(self._limbs, 0), dict.fromkeys(self._limbs, -plan.ticks)
        risen, gave = set[str](), list[tuple[int, tuple[str, ...]]]()
        k, last, solved = 0, plan.ticks - 1, Status.SOLVED
        while k < last:
            asked = [name for name, limb in zip(self._limbs, limbs, strict=True) if limb.held[k]]
            waiting = [name for name in asked if self._held.get(name, ContactGrip.FREE) is ContactGrip.FREE]
            there = self._near(plan, [name for name in waiting if k >= not_before[name]], out[k], k)
            kept = [name for name in asked if name in there or name not in waiting]
            risen &= set(kept)
            # Hands are held in place until they have to rise
            firm = {n: plan.limbs[n].grip(k) if n in risen else ContactGrip.FIRM for n in kept}
            self._hold(dict.fromkeys(self._limbs, ContactGrip.FREE) | firm)
            waiting = [name for name in waiting if name not in there]
            since |= dict.fromkeys(there, k)
            later = int(np.searchsorted(changing, k, side="right"))
            stop = min(int(changing[later]) if later < len(changing) else last, last)
            for name in waiting:
                stop = min(stop, max(not_before[name], k + 1))
            lying = [n for n, limb in plan.limbs.items() if limb.lies[k] and self._held.get(n) is ContactGrip.FIRM]
            self._ticks.most = PUSHED if lying else np.inf
            self.controller.iteration_cap = TRIED if self._landing(plan, k, since) else None
            done, step = self._ticks.run(rows[k:stop], out[k : stop + 1])
            self.controller.iteration_cap = None
            k += done
            if step is None:
                continue
            v = self._ticks.velocity_before
            if step.status is not solved:
                # Feet that come to stand give way before those that stand
                landing = self._landing(plan, k, since)
                self._hold(dict.fromkeys(landing, ContactGrip.FREE))
                not_before |= dict.fromkeys(landing, k + AGAIN)
                if landing or step.status is Status.CAPPED:
                    step = self.controller.step(out[k], v)
            slipping = [name for name in self._limbs if any(slack.item == f"{name} stands" for slack in step.relaxed)]
            if slipping:
                # What cannot be held still is led to its place above the ground
                self._hold(dict.fromkeys(slipping, ContactGrip.FREE))
                not_before |= dict.fromkeys(slipping, k + AGAIN)
                step = self.controller.step(out[k], v)
            lying = [name for name in lying if self._held[name] is ContactGrip.FIRM]
            if lying and any(slack.item == ARMS and slack.amount > PUSHED for slack in step.relaxed):
                # Hands that lie on the ground rise where their links would sink
                risen |= set(lying)
                self._hold(dict.fromkeys(lying, ContactGrip.LEVEL))
                step = self.controller.step(out[k], v)
            if step.status is not solved:
                gave.append((k, tuple(dict.fromkeys(slack.item for slack in step.relaxed)) or (str(step.status),)))
            out[k + 1], k = step.q_next, k + 1
        return out, gave

    def follow(self, places: Array, turns: Array, held: Mapping[str, ContactGrip], q: Array) -> Array:
        """Ticks from q along some of :meth:`targets`; the configuration after the last."""
        self._hold(held)
        self._ticks.most = np.inf
        out = np.empty((len(places), len(q)))
        out[0] = q
        self._ran(self.rows(places, turns)[:-1], out)
        return np.asarray(out[-1])

    def _near(self, plan: MotionPlan, names: list[str], q: Array, tick: int) -> list[str]:
        """Those of some limbs whose contacts are so near to their targets that they can be held from here on."""
        model, data, out = self.robot.model, self._data, []
        if names:
            pin.forwardKinematics(model, data, q)
        for name in names:
            limb = plan.limbs[name]
            pose = pin.updateFramePlacement(model, data, self._ends[name])
            away = pose.translation - limb.end[tick]
            off = float(np.linalg.norm(away[:2] if limb.grip(tick) is ContactGrip.LEVEL else away))
            if limb.rotation is not None and self.body.limbs[name].contact == "flat":
                off = float(np.hypot(off, LEVER * np.linalg.norm(pin.log3(pose.rotation @ limb.rotation[tick].T))))
            if off < (FOOT_ENGAGED if self.body.is_foot(name) else HAND_ENGAGED):
                out.append(name)
        return out

    def _landing(self, plan: MotionPlan, tick: int, since: Mapping[str, int]) -> list[str]:
        """Limbs that are held and whose stance has not begun long ago, or that are held since not long ago."""
        first = max(tick - round(LANDING / self.dt), 0)
        held = [name for name, grip in self._held.items() if grip is not ContactGrip.FREE]
        return [n for n in held if tick > 0 and (since[n] > first or not plan.limbs[n].stands[first])]


def _solid(corners: Array) -> PlacedShape:
    """The hull of some corners in a link's frame; what is flat gets a thickness."""
    if len(corners) < 4 or np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] < THIN:
        sides = np.array([[x, y, z] for x in (-THIN, THIN) for y in (-THIN, THIN) for z in (-THIN, THIN)])
        corners = (corners[:, None] + sides).reshape(-1, 3)
    return PlacedShape(Convex(corners), pin.SE3.Identity())


def _joints_between(robot: Robot, first: str, second: str) -> int:
    """How many joints lie on the way from one link to another."""
    model = robot.model
    a, b = ({*model.supports[model.frames[model.getFrameId(link)].parentJoint]} for link in (first, second))
    return len(a ^ b)


def _next(values: Array) -> Array:
    return np.concatenate([values[1:], values[-1:]])
