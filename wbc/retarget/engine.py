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
from wbc.controller.step import Step
from wbc.multibody import pin
from wbc.retarget.clip import Array
from wbc.retarget.options import RetargetOptions
from wbc.retarget.plan import balanced, logarithms
from wbc.retarget.robot_body import RobotBody, with_frame
from wbc.retarget.targets import CHAIN, ContactGrip, Targets
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
    """A robot with limits of velocity and acceleration for every joint: the description's where it has one."""
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


class _TargetFollower(NamedTuple):
    """An item that follows a place and a turn of the targets, "" where none; at the next ones, if it stands."""

    item: str
    place: str
    turn: str
    stands: bool


class Engine:
    """The compiled stack of a robot that follows targets, tick by tick.

    Attributes:
        robot: with its limits. controller: of the stack.
    """

    def __init__(
        self, body: RobotBody, limbs: Sequence[str], options: RetargetOptions, dt: float, *, head: bool = False
    ) -> None:
        self.body, self.options, self.dt, self._limbs = body, options, dt, tuple(limbs)
        free = body.robot.base != "fixed"
        self._holds, self._gain = free and options.hold, min(GAIN / dt, FASTEST)
        self._followers: list[_TargetFollower] = []
        self._ground: list[str] = []
        self._own_ground: dict[str, str] = {}
        self.robot = self._shaped(limited(body.robot, options))
        self._stack = stack = Stack(self.robot, dt=dt, calm=False)
        self._add_trunk(free, head)
        for name in self._limbs:
            self._add_limb(name)
        stack.add(tasks.Posture(start="neutral", gain=1.0), name="posture", weight=options.weights.posture)
        stack.add(tasks.JointLimits(shortest_dt=dt), name="limits")
        if options.clearance is not None:
            clear = tasks.SelfCollision(margin=options.clearance, closest=CLOSEST, method="sensed")
            stack.add(clear, name="clearance", soft=CLEARANCE_PRICE)
        if free:
            self._add_ground()
            #: the root as seen from the pelvis, where the robot is as at rest
            neutral = body.robot.neutral
            self._root = body.robot.pose(neutral, body.pelvis).inverse() * pin.XYZQUATToSE3(neutral[:7])
        self.controller: Controller = stack.compile()
        for item in self._ground:
            self.controller[item].rate = GROUND_RATE / dt
        for name in self._limbs if self._holds else ():
            self.controller[f"{name} stands"].enabled = False
        inputs = [(f.item, part, None) for f in self._followers for part in ("target", "feedforward")[: 2 - f.stands]]
        self._ticks = RowTicks(self.controller, inputs, ARMS if ARMS in self._ground else "")
        self._turns = tuple(dict.fromkeys(("pelvis", "", *(f.turn for f in self._followers))))
        self._order = self._order_of()
        self._held = dict.fromkeys(self._limbs, ContactGrip.FREE)
        self._data = self.robot.model.createData()
        self._ends = [int(self.robot.model.getFrameId(body.limbs[name].end)) for name in self._limbs]
        tasks_there = [entry.name for entry in stack.entries if isinstance(entry.item, Task)]
        self._gains = InputGroup(core_of(self.controller), [(item, "gain", None) for item in tasks_there])
        self._own_gains = np.array([self.controller[item].gain for item in tasks_there])

    def _shaped(self, robot: Robot) -> Robot:
        """The robot with hulls of what may touch the ground, and where clearances are asked for shapes on all links."""
        pairs = robot.self_pairs
        if self.options.clearance is not None:
            robot = robots.fit_shapes(robot)
            found = robots.find_self_pairs(robot, samples=PAIR_SAMPLES).kept
            pairs = tuple(pair for pair in found if _joints_between(robot, *pair) > NEIGHBOURS)
        limbs, shapes = self.body.limbs, dict[str, list[PlacedShape]]()
        #: frames of links besides ends: of arms, and of all others
        self._arms, self._links = list[str](), list[str]()
        ends = {limb.joints[-1] for limb in limbs.values()}
        of_arms = {joint for name, limb in limbs.items() if not self.body.is_foot(name) for joint in limb.joints}
        for name, limb in limbs.items():
            ball = np.linalg.norm(limb.surface, axis=1) <= limb.radius + NEAR_ENOUGH
            if self.body.is_foot(name) and limb.contact == "point" and ball.any() and not ball.all():
                # A point foot's ball is off the ground however its leg turns, what is above the ball is not
                end, frame = robot.model.frames[robot.model.getFrameId(limb.end)], f"retarget_ground_{name}"
                robot = with_frame(robot, frame, int(end.parentJoint), end.placement)
                shapes |= {limb.end: [_solid(limb.surface[ball])], frame: [_solid(limb.surface[~ball])]}
                self._links.append(frame)
            else:
                shapes[limb.end] = [_solid(limb.surface)]
        for joint, balls in self.body.balls.items() if robot.base != "fixed" else ():
            if joint not in ends:
                frame = f"retarget_ground_{joint}"
                robot = with_frame(robot, frame, joint, pin.SE3.Identity())
                shapes[frame] = [_solid(balls.corners(LINK_CORNERS, NEAR_ENOUGH))]
                (self._arms if joint in of_arms else self._links).append(frame)
        return robot.with_shapes({**robot.shapes, **shapes}).with_self_pairs(pairs)

    def _follow(
        self,
        item: str,
        task: Task | StillContact,
        place: str = "",
        turn: str = "",
        weight: float = 1.0,
        *,
        stands: bool = False,
    ) -> None:
        """Add a task that follows a place, a turn or both."""
        self._stack.add(task, name=item, weight=weight)
        self._followers.append(_TargetFollower(item, place, turn, stands))

    def _add_trunk(self, free: bool, head: bool) -> None:
        """Add what follows pelvis, chest and head, and the centre of mass over the contacts."""
        body, weights, balance = self.body, self.options.weights, self.options.balance
        self._balances = bool(balance and free)
        if free:
            six = (weights.pelvis,) * 3 + (weights.turn,) * 3
            self._follow("pelvis", tasks.EndEffector(body.pelvis, weights=six, gain=self._gain), "pelvis", "pelvis")
        chest = body.chest if body.plan.upright and body.plan.chest != body.plan.pelvis else ""
        for name, frame, weight in (("chest", chest, weights.chest), ("head", body.head if head else "", weights.head)):
            if frame:
                self._follow(name, tasks.EndEffector(frame, "orientation", gain=self._gain), turn=name, weight=weight)
        if self._balances:
            # Over the contacts, wherever their height
            mass = tasks.CenterOfMass(weights=(1.0, 1.0, 0.0), gain=self._gain)
            self._follow("balance", mass, "balance", weight=balance)

    def _add_limb(self, name: str) -> None:
        """Add what follows a limb's targets."""
        body, weights, limb = self.body, self.options.weights, self.body.limbs[name]
        flat, foot = limb.contact == "flat", self.body.is_foot(name)
        points = [("middle", limb.middle, weights.middle)] if body.plan.upright else []
        if not foot:
            points += [("wrist", limb.wrist, weights.wrist), ("end", limb.end, 0.1 * weights.wrist)]
        elif not flat:
            points.append(("end", limb.end, weights.foot))
        for part, frame, weight in points:
            if frame:
                item, place = name if part == "end" else f"{name} {part}", f"{name} {part}"
                self._follow(item, tasks.EndEffector(frame, "position", gain=self._gain), place, weight=weight)
        if foot and flat:
            six = (weights.foot,) * 3 + (weights.sole,) * 3
            self._follow(name, tasks.EndEffector(limb.end, weights=six, gain=self._gain), f"{name} end", name)
        if self._holds:
            still = StillContact(limb.end, "pose" if flat else "position", gain=1.0 / self.dt)
            self._follow(f"{name} stands", still, f"{name} end", name if flat else "", stands=True)

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

    def _order_of(self) -> NDArray[np.int_]:
        """Which of the numbers of :meth:`rows`, before they are put in order, each item's inputs are."""
        names = ["pelvis", *(f"{limb} {part}" for limb in self._limbs for part in CHAIN), "balance"]
        turns, places = len(self._turns), len(names) - (not self._balances)
        blocks = np.split(np.arange(21 * turns + 9 * places), np.cumsum([18 * turns, 6 * places, 3 * places]))
        targets, points = blocks[0].reshape(2, turns, 9), blocks[1].reshape(2, places, 3)
        rates, spins, order = blocks[2].reshape(places, 3), blocks[3].reshape(turns, 3), list[NDArray[np.int_]]()
        for follower in self._followers:
            ahead, place = int(follower.stands), [names.index(follower.place)] if follower.place else []
            turn = [self._turns.index(follower.turn)] if follower.turn or ahead else []
            order += [targets[ahead, turn], points[ahead, place], *(() if ahead else (rates[place], spins[turn]))]
        return np.concatenate([columns.ravel() for columns in order])

    def table(self, targets: Targets) -> tuple[Array, Array]:
        """Positions [ticks, places, 3] and rotations [ticks, turns, 3, 3] that the stack follows, the pelvis' first."""
        places, level = targets.places, np.zeros((len(targets.pelvis), 3, 3)) + np.eye(3)
        if self._balances:
            places = np.concatenate([places, balanced(targets)[:, None]], axis=1)
        return places, np.array([targets.turns.get(name, level) for name in self._turns]).swapaxes(0, 1)

    def rows(self, places: Array, turns: Array) -> Array:
        """Numbers of all inputs over ticks [ticks, numbers], of :meth:`table`."""
        ticks, dt = len(places), self.dt
        next_places, next_turns = (np.concatenate([values[1:], values[-1:]]) for values in (places, turns))
        steps = next_turns @ np.swapaxes(turns, -1, -2)
        numbers = (
            np.swapaxes(turns, -1, -2), np.swapaxes(next_turns, -1, -2), places, next_places,
            (next_places - places) / dt, logarithms(steps.reshape(-1, 3, 3)) / dt,
        )  # fmt: skip
        return np.take(np.concatenate([values.reshape(ticks, -1) for values in numbers], axis=1), self._order, axis=1)

    def start(self, places: Array, turns: Array, held: Mapping[str, ContactGrip]) -> Array:
        """Bring the robot to the first of a table, held so, with the velocity with which it goes on; where it is."""
        robot, controller = self.robot, self.controller
        q = robot.neutral.copy()
        if robot.base != "fixed":
            q[:7] = pin.SE3ToXYZQUAT(pin.SE3(turns[0, 0], places[0, 0]) * self._root)
            q[3:7] /= np.linalg.norm(q[3:7])
        first, second = (self.rows(places[[k]], turns[[k]])[0] for k in (0, min(1, len(places) - 1)))
        fast = np.full(len(self._own_gains), GAIN / self.dt)
        self.hold({})
        self._gains.write(fast)
        q, _ = self._settled(q, first, SETTLING)
        # What is held jumps to its place, so it is brought there before; what cannot be there, or leads the trunk away
        # as it goes there, is not held
        self.hold(held)
        placed, served = self._settled(q, first, SETTLING // 4)
        if not served or (self._holds and float(np.linalg.norm(placed[:3] - q[:3])) >= LED_AWAY):
            # With gains of their own tasks push feet less into the ground
            self.hold({})
            self._gains.write(self._own_gains)
            placed, _ = self._settled(q, first, SETTLING // 4)
            self._gains.write(fast)
        after, _ = self._settled(placed, second, SETTLING // 4)
        self._gains.write(self._own_gains)
        limit = robot.limits.velocity
        controller.reset(placed, np.clip(pin.difference(robot.model, placed, after) / self.dt, -limit, limit))
        return placed

    def _settled(self, q: Array, row: Array, most: int) -> tuple[Array, bool]:
        """Where ticks with the same inputs lead, and whether nothing gives way there."""
        self.controller.reset(q)
        self._ticks.rest = SETTLED
        out, served = self._ran(np.tile(row, (most, 1)), q)
        self._ticks.rest = 0.0
        return out, served

    def _ran(self, rows: Array, q: Array) -> tuple[Array, bool]:
        """Where ticks of some rows lead, whatever gives way, and whether nothing does in the last one."""
        out, done, step = np.empty((len(rows) + 1, len(q))), 0, None
        out[0], self._ticks.most = q, np.inf
        while done < len(rows):
            count, step = self._ticks.run(rows[done:], out[done:])
            done += count
            if step is None:
                break
            out[done + 1], done = step.q_next, done + 1
        return np.asarray(out[done]), step is None and len(rows) > 0

    def hold(self, wanted: Mapping[str, ContactGrip]) -> None:
        """Hold contacts, and let all others go."""
        for name in self._limbs:
            self._grip(name, wanted.get(name, ContactGrip.FREE))

    def _grip(self, name: str, grip: ContactGrip) -> None:
        if self._holds and self._held[name] is not grip:
            contact = self.controller[f"{name} stands"]
            if name in self._own_ground:
                self.controller[self._own_ground[name]].enabled = grip is ContactGrip.FREE
            else:
                # The hull of a hand that lies on the ground may ask it to be higher, by the rows of the ground
                contact.mask = (1.0, 1.0, float(grip is ContactGrip.FIRM))
                self.controller[name].mask = (1.0, 1.0, LYING if grip is ContactGrip.LEVEL else 1.0)
            contact.enabled = grip is not ContactGrip.FREE
            self._held[name] = grip

    def run(self, plan: Targets) -> tuple[Array, list[tuple[int, tuple[str, ...]]]]:
        """Configurations at all ticks [ticks, nq], and ticks at which rows gave way with the names of their items."""
        places, turns = self.table(plan)
        rows, last = self.rows(places, turns), len(places) - 1
        out = np.empty((len(rows), self.robot.nq))
        out[0] = self.start(places, turns, plan.grips(0))
        marks = np.concatenate([plan.held, plan.lies], axis=1)
        changing = [0, *(np.flatnonzero((marks[1:] != marks[:-1]).any(axis=1)) + 1).tolist(), last]
        #: limb -> the first tick in which it may be held again, and the tick from which it is held
        not_before, since = dict.fromkeys(self._limbs, 0), dict.fromkeys(self._limbs, -len(rows))
        risen, gave, k = set[str](), list[tuple[int, tuple[str, ...]]](), 0

        def again(names: Sequence[str], grip: ContactGrip = ContactGrip.FREE) -> Step:
            """The tick with other grips; contacts that are let go are tried again later."""
            for name in names:
                self._grip(name, grip)
                not_before[name] = k + AGAIN if grip is ContactGrip.FREE else not_before[name]
            return self.controller.step(out[k], v)

        while k < last:
            asked = plan.grips(k)
            waiting = [name for name in asked if self._held[name] is ContactGrip.FREE]
            there = self._near(plan, [name for name in waiting if k >= not_before[name]], out[k], k)
            waiting = [name for name in waiting if name not in there]
            risen &= {name for name in asked if name not in waiting}
            # Hands are held in place until they have to rise
            self.hold({n: g if n in risen else ContactGrip.FIRM for n, g in asked.items() if n not in waiting})
            since |= dict.fromkeys(there, k)
            stop = min([t for t in changing if t > k][:1] + [max(not_before[name], k + 1) for name in waiting])
            lying = [n for n, lies in zip(self._limbs, plan.lies[k], strict=True) if lies and self._firm(n)]
            self._ticks.most = PUSHED if lying else np.inf
            self.controller.iteration_cap = TRIED if self._landing(plan, k, since) else None
            done, step = self._ticks.run(rows[k:stop], out[k : stop + 1])
            self.controller.iteration_cap = None
            k += done
            if step is None:
                continue
            v = self._ticks.velocity_before
            if step.status is not Status.SOLVED:
                # Feet that come to stand give way before those that stand
                landing = self._landing(plan, k, since)
                if landing or step.status is Status.CAPPED:
                    step = again(landing)
            relaxed = {entry.item for entry in step.relaxed}
            if slipping := [name for name in self._limbs if f"{name} stands" in relaxed]:
                # What cannot be held still is led to its place above the ground
                step = again(slipping)
            lying = [name for name in lying if self._firm(name)]
            if lying and any(entry.item == ARMS and entry.amount > PUSHED for entry in step.relaxed):
                # Hands that lie on the ground rise where their links would sink
                risen |= set(lying)
                step = again(lying, ContactGrip.LEVEL)
            if step.status is not Status.SOLVED:
                gave.append((k, tuple(dict.fromkeys(entry.item for entry in step.relaxed)) or (str(step.status),)))
            out[k + 1], k = step.q_next, k + 1
        return out, gave

    def follow(self, places: Array, turns: Array, held: Mapping[str, ContactGrip], q: Array) -> Array:
        """Ticks from q along a table; the configuration after the last."""
        self.hold(held)
        return self._ran(self.rows(places, turns)[:-1], q)[0]

    def _firm(self, name: str) -> bool:
        return self._held[name] is ContactGrip.FIRM

    def _near(self, plan: Targets, names: list[str], q: Array, tick: int) -> list[str]:
        """Those of some limbs whose contacts are so near to their targets that they can be held from here on."""
        model, data, out = self.robot.model, self._data, []
        if names:
            pin.forwardKinematics(model, data, q)
        for name in names:
            limb = self._limbs.index(name)
            pose = pin.updateFramePlacement(model, data, self._ends[limb])
            away = pose.translation - plan.chains[tick, limb, 3]
            off = float(np.linalg.norm(away[:2] if plan.grips(tick)[name] is ContactGrip.LEVEL else away))
            if self.body.limbs[name].contact == "flat":
                off = float(np.hypot(off, LEVER * np.linalg.norm(pin.log3(pose.rotation @ plan.turns[name][tick].T))))
            if off < (FOOT_ENGAGED if self.body.is_foot(name) else HAND_ENGAGED):
                out.append(name)
        return out

    def _landing(self, plan: Targets, tick: int, since: Mapping[str, int]) -> list[str]:
        """Limbs that are held and whose stance has not begun long ago, or that are held since not long ago."""
        first = max(tick - round(LANDING / self.dt), 0)
        young = [n for n, stood in zip(self._limbs, plan.stands[first], strict=True) if since[n] > first or not stood]
        return [n for n in young if tick > 0 and self._held[n] is not ContactGrip.FREE]


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
