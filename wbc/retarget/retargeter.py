"""From a clip to a motion of a robot."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from wbc import robots, validation
from wbc.errors import NotFiniteError, ShapeError
from wbc.retarget.clip import Array, Clip, Skeleton
from wbc.retarget.correspondence import Correspondence, CorrespondenceError, correspondence
from wbc.retarget.engine import Engine
from wbc.retarget.live import LiveRetargeter
from wbc.retarget.mapping import Mapper
from wbc.retarget.options import RetargetOptions
from wbc.retarget.plan import Planner
from wbc.retarget.retargeted import Retargeted, served
from wbc.retarget.robot_body import RobotBody, body_of
from wbc.retarget.stances import Stances, find_stances
from wbc.robot import Robot

#: Hands of a person lead front legs where they are on the ground for this share of the clip
ON_HANDS = 0.3
#: Shortest leg of a skeleton, so that speeds count [m]
LEAST_LEG = 0.05


class Retargeter:
    """Brings clips of people and animals onto a robot.

        motion = wbc.retarget.Retargeter(wbc.robots.load("g1")).run(clip)
        motion.q, motion.stance, motion.errors

    Which points lead which links is found (:attr:`correspondence` shows it); feet that stand are hard constraints, and
    limits of position, velocity and acceleration are kept in every tick.

    Args:
        robot: a robot, its name or its file.
        skeleton: of the clips; None: each clip's own.
        options: see :class:`RetargetOptions`.
        correspondence: a file of :meth:`Correspondence.save` whose parts replace what is found; None: no file.

    Raises:
        BodyError: a robot without limbs. CorrespondenceError: a skeleton that cannot lead it, or a bad file.
        WbcError: as of :func:`wbc.robots.load`.
    """

    def __init__(
        self,
        robot: Robot | str | os.PathLike[str],
        skeleton: Skeleton | None = None,
        options: RetargetOptions | None = None,
        *,
        correspondence: str | os.PathLike[str] | None = None,
    ) -> None:
        loaded = robot if isinstance(robot, Robot) else robots.load(os.fspath(robot))
        self.options = validation.instance("options", options or RetargetOptions(), RetargetOptions, "RetargetOptions")
        self.body: RobotBody = body_of(loaded)
        self.skeleton, self._file = skeleton, correspondence
        self._matches: dict[Any, Correspondence] = {}
        self._engines: dict[Any, Engine] = {}
        if skeleton is not None:
            self.correspondence(skeleton)

    def correspondence(self, skeleton: Skeleton | None = None, *, all_fours: bool | None = None) -> Correspondence:
        """Which points of a skeleton lead which links; by default the skeleton that was given.

        Raises:
            CorrespondenceError: no skeleton is known, or it cannot lead the robot.
        """
        given = skeleton or self.skeleton
        if given is None:
            raise CorrespondenceError("skeleton", None, "give a skeleton, or run a clip first")
        fours = bool(self.options.all_fours) if all_fours is None else all_fours
        key = (given.names, given.parents, np.asarray(given.offsets).tobytes(), fours)
        if key not in self._matches:
            match = correspondence(self.body, given, all_fours=fours)
            if self._file is not None:
                match = match.read(self._file)
            if self.options.scale is not None:
                match = match.corrected({"scale": self.options.scale})
            self._matches[key] = match
        return self._matches[key]

    def run(self, clip: Clip) -> Retargeted:
        """The motion of the robot that follows a clip.

        Raises:
            ShapeError, NotFiniteError: a clip without frames, or with numbers that are none.
            CorrespondenceError: its skeleton cannot lead the robot.
        """
        _check(clip, self.skeleton)
        match, stances = self._matched(clip)
        options = self.options
        rate = options.rate or clip.rate
        every = max(int(np.ceil(options.tick_rate / rate - 1e-9)), 1)
        dt = 1.0 / (rate * every)
        frames = int(np.floor((len(clip.points) - 1) / clip.rate * rate + 1e-6)) + 1
        times: Array = np.asarray(np.arange((frames - 1) * every + 1) * dt, dtype=np.float64)
        mapper = Mapper(match, clip.rate)
        targets = mapper.targets(clip.points, clip.turns, stances.ankle)
        for k, name in enumerate(mapper.limbs):
            targets.stands[:, k] = stances.marks[match.limbs[name].source]
        plan = Planner(self.body, mapper.limbs).plan(targets, times)
        engine = self.engine(mapper.limbs, dt, head="head" in plan.turns)
        all_q, gave = engine.run(plan)
        landed, given_up = served(engine.robot, self.body, plan, all_q, gave)
        return Retargeted(
            robot=engine.robot, rate=rate, time=times[::every], q=all_q[::every], given_up=given_up,
            stance={name: stands[::every] for name, stands in landed.items()}, notes=(*clip.notes, *match.notes),
            clip=clip, body=self.body, plan=plan, every=every, all_q=all_q,
        )  # fmt: skip

    def live(self, rate: float = 50.0) -> LiveRetargeter:
        """Frames one at a time, as they come; see :class:`LiveRetargeter`.

        Args:
            rate: at which they come [Hz].

        Raises:
            RangeError: of the rate. CorrespondenceError: no skeleton was given to the retargeter.
        """
        match = self.correspondence()
        rate = validation.scalar("rate", rate, low=1.0, high=1000.0, unit="Hz")
        every = max(int(np.ceil(self.options.tick_rate / rate - 1e-9)), 1)
        limbs = tuple(name for name in self.body.limbs if name in match.limbs)
        return LiveRetargeter(match, self.engine(limbs, 1.0 / (rate * every)), rate, every)

    def engine(self, limbs: tuple[str, ...], dt: float, *, head: bool = False) -> Engine:
        """The compiled stack for ticks of some length; made once."""
        key = (limbs, round(dt, 9), head)
        if key not in self._engines:
            self._engines[key] = Engine(self.body, limbs, self.options, dt, head=head)
        return self._engines[key]

    def _matched(self, clip: Clip) -> tuple[Correspondence, Stances]:
        """The correspondence for a clip, and its stances."""
        match = self.correspondence(clip.skeleton)
        stances = stances_of(match, clip)
        if self.options.all_fours is None and match.upright and not self.body.plan.upright:
            fours = self.correspondence(clip.skeleton, all_fours=True)
            found = stances_of(fours, clip)
            hands = [marks.mean() for name, marks in found.marks.items() if name.endswith("arm")]
            if fours.limbs["left_leg"].source == "left_leg" and hands and min(hands) > ON_HANDS:
                return fours, found
        return match, stances


def stances_of(match: Correspondence, clip: Clip) -> Stances:
    """Stances of a clip, of the skeleton's limbs that lead a robot's."""
    ends = {limb.source: clip.points[:, [limb.end, limb.tip]] for limb in match.limbs.values()}
    feet = {source: points for source, points in ends.items() if source.endswith("leg")}
    hands = {source: points for source, points in ends.items() if source not in feet}
    lengths = [limb.length(match.skeleton.rest) for limb in match.limbs.values() if limb.source in feet]
    return find_stances(feet, hands, clip.rate, max(float(np.mean(lengths)) if lengths else 1.0, LEAST_LEG))


def _check(clip: Clip, skeleton: Skeleton | None) -> None:
    """A clip whose arrays fit its skeleton."""
    validation.instance("clip", clip, Clip, "a Clip")
    joints = len(clip.skeleton.names)
    points = np.asarray(clip.points)
    if points.ndim != 3 or points.shape[1:] != (joints, 3) or len(points) < 1:
        raise ShapeError("clip.points", points.shape, f"expected [frames, {joints}, 3] with a frame at least")
    if clip.turns is not None:
        validation.real_array("clip.turns", clip.turns, (len(points), joints, 3, 3))
    validation.scalar("clip.rate", clip.rate, low=1.0, high=1e4, unit="Hz")
    bad = np.argwhere(~np.isfinite(points).all(axis=2))
    if len(bad):
        frame, joint = bad[0]
        raise NotFiniteError("clip.points", points[frame, joint], f"{clip.skeleton.names[joint]} at frame {frame}")
    if skeleton is not None and clip.skeleton.names != skeleton.names:
        raise CorrespondenceError("clip.skeleton", clip.name, "its points are not those of the skeleton that was given")
