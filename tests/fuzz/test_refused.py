"""Calls that once gave a bare error, hung, or passed: each is refused, by the name of what was wrong."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import wbc
from tests.fuzz.arm import BOUNDS, ONE, TIP, Q, compiled, plain, robot, solvers
from tests.fuzz.surface import impatient
from wbc import analysis, coordinates, resolvers, shapes, tasks, teleop, track, trajectory
from wbc.errors import BoundsError, NotFiniteError, RangeError, ShapeError, UnknownNameError, WbcError
from wbc.proximity import distances
from wbc.robots import DHRow


def law() -> trajectory.Law:
    return trajectory.jerk_limited(np.zeros(3), Q, **BOUNDS)


def expression(*inputs: Any) -> tasks.Expression:
    return tasks.Expression(lambda kin, p: kin.position(TIP)[0], units="m", inputs=inputs)


def step() -> wbc.Step:
    return plain().compile(backend="vm").step(Q)


def rows() -> coordinates.BodyRows:
    return coordinates.BodyRows(TIP, rotation=())


def pair() -> coordinates.CoordinatePair:
    return coordinates.CoordinatePair(rows(), ())


def conditioning() -> coordinates.Conditioning:
    return coordinates.Conditioning(robot(), [[rows()]], backend="vm")


def model() -> analysis.ExactModel:
    return analysis.ExactModel(robot(), approximate=True)


def way() -> track.SplinePath:
    return track.SplinePath([0.0, 1.0], [ONE, ONE])


def scene() -> track.Scene:
    out = track.Scene(robot())
    out.add_robot(Q)
    return out


def problem() -> resolvers.RateProblem:
    return resolvers.RateProblem(np.eye(2, 3), np.ones(2))


#: What is called, the error, and what its message names
CALLS: dict[str, tuple[Callable[[], Any], type[WbcError], str]] = {
    "distances robot": (lambda: distances("arm", [], Q), ShapeError, "robot"),
    "fit_shapes robot": (lambda: wbc.robots.fit_shapes("arm"), ShapeError, "robot"),
    "fit_shapes count": (lambda: wbc.robots.fit_shapes(robot(), count=2**70), RangeError, "count"),
    "fit_shapes folders": (lambda: wbc.robots.fit_shapes(robot(), package_dirs=3), ShapeError, "package_dirs"),
    "pairs of no robot": (lambda: wbc.robots.find_self_pairs(3), ShapeError, "robot"),
    "pairs progress": (lambda: wbc.robots.find_self_pairs(robot(), progress=3), ShapeError, "progress"),
    "read pairs": (lambda: wbc.robots.read_self_pairs(3, robot()), ShapeError, "path"),
    "read pairs of no robot": (lambda: wbc.robots.read_self_pairs("pairs.toml", 3), ShapeError, "robot"),
    "save pairs": (lambda: wbc.robots.save_self_pairs(3, "pairs.toml"), ShapeError, "found"),
    "load neutral": (lambda: wbc.robots.load("panda", neutral=[1.0]), ShapeError, "neutral"),
    "with_frame": (lambda: robot().with_frame(3, TIP), ShapeError, "frame"),
    "with_shapes": (lambda: robot().with_shapes([1]), ShapeError, "shapes"),
    "with_shapes of names": (lambda: robot().with_shapes({"link1": "box"}), ShapeError, "shapes[link1]"),
    "with_self_pairs": (lambda: robot().with_self_pairs(3), ShapeError, "self_pairs"),
    "with_self_pairs of lists": (lambda: robot().with_self_pairs([[["a"], "b"]]), ShapeError, "self_pairs"),
    "limits override": (lambda: robot().limits.override(speed=1.0), UnknownNameError, "limit"),
    "from_dh": (lambda: wbc.robots.from_dh(np.ones((2, 2))), ShapeError, "rows"),
    "from_dh name": (lambda: wbc.robots.from_dh([DHRow()], name=3), ShapeError, "name"),
    "DHRow name": (lambda: DHRow(name=3), ShapeError, "DHRow.name"),
    "walker": (lambda: wbc.robots.walker(arms=2**70), RangeError, "arms"),
    "placed shape": (lambda: shapes.PlacedShape("ball", ONE), ShapeError, "PlacedShape.shape"),
    "placed excess": (lambda: shapes.PlacedShape(shapes.Sphere(0.1), ONE, math.nan), NotFiniteError, "excess"),
    "placed nowhere": (lambda: shapes.PlacedShape(shapes.Sphere(0.1), 3), ShapeError, "PlacedShape.placement"),
    "Input bounds": (lambda: plain().add(expression(tasks.Input("a", low={}, default=0.0))), ShapeError, "low"),
    "Input unit": (lambda: plain().add(expression(tasks.Input("a", unit=3, default=0.0))), ShapeError, "unit"),
    "gain": (lambda: plain().add(tasks.EndEffector(TIP, gain="abc")), ShapeError, "EndEffector.gain"),
    "gain below 0": (lambda: plain().add(tasks.Posture(gain=-1.0)), RangeError, "Posture.gain"),
    "weight": (lambda: plain().add(tasks.Posture(), weight=1e308), RangeError, "weight"),
    "solver goals": (lambda: plain().inverse_kinematics(goals=3), ShapeError, "goals"),
    "solver of no stack": (lambda: wbc.InverseKinematics("stack"), ShapeError, "stack"),
    "solve targets": (lambda: plain().solve(Q, [1]), ShapeError, "targets"),
    "restarts": (lambda: solvers().solve(Q, restarts=2**70), RangeError, "restarts"),
    "seed": (lambda: solvers().solve(Q, seed=2**70), RangeError, "seed"),
    "batch": (lambda: solvers().solve_batch(Q, {"hand": 3}), ShapeError, "targets[hand]"),
    "batch of nothing": (lambda: solvers().solve_batch(Q, 3), ShapeError, "targets"),
    "batch without target": (lambda: solvers().solve_batch(Q, {"limits": [1]}), UnknownNameError, "limits.target"),
    "along": (lambda: solvers().along(np.ones(3), [0.0, 1.0], Q), ShapeError, "targets"),
    "record": (lambda: compiled().clone().record(3), ShapeError, "path"),
    "record overwrite": (lambda: compiled().clone().record("a", overwrite="no"), ShapeError, "overwrite"),
    "replay": (lambda: wbc.replay(3), ShapeError, "path"),
    "replay of a null": (lambda: wbc.replay("a\0b"), ShapeError, "path"),
    "recording": (lambda: wbc.Recording(b"bytes"), ShapeError, "path"),
    "export": (lambda: compiled().export(3), ShapeError, "folder"),
    "derivative": (lambda: step().derivative([1]), UnknownNameError, "derivative"),
    "derivative of a list": (lambda: step().derivative("hand", ["target"]), UnknownNameError, "derivative.hand"),
    "pairs": (lambda: compiled().pairs("typo"), UnknownNameError, "item"),
    "law save": (lambda: law().save(3), ShapeError, "file"),
    "law load": (lambda: trajectory.load(3), ShapeError, "file"),
    "law checks": (lambda: trajectory.Law(law().path, law().timing, checks="ab"), ShapeError, "checks"),
    "law then": (lambda: law().then(3), ShapeError, "other"),
    "law limits": (lambda: law().with_limits("fast"), ShapeError, "limits"),
    "plot": (lambda: trajectory.plot(3, "a.png"), ShapeError, "law"),
    "follow": (lambda: trajectory.follow(plain(), 3, Q, "hand"), ShapeError, "poses"),
    "time_optimal": (lambda: trajectory.time_optimal(law().path, limits=3), ShapeError, "limits"),
    "evaluate": (lambda: law().path.evaluate("here"), ShapeError, "s"),
    "evaluate order": (lambda: law().path.evaluate([0.0], 7), RangeError, "order"),
    "evaluate piece": (lambda: law().path.evaluate([0.0], 0, [99]), RangeError, "piece"),
    "evaluate far away": (lambda: law().path.evaluate([1e200]), RangeError, "s"),
    "subnormal limits": (lambda: trajectory.MotionLimits(velocity=[1e-320]), RangeError, "limits.velocity"),
    "subnormal jerk": (lambda: trajectory.jerk_limited(0 * Q, Q, **BOUNDS | {"jerk": 1e-320}), RangeError, "jerk"),
    "huge waypoints": (lambda: trajectory.spline_path([[0.0], [1e200]]), RangeError, "waypoints"),
    "subnormal dt": (lambda: wbc.Stack(robot(), 1e-320), RangeError, "dt"),
    "load of a long name": (lambda: wbc.robots.load("x" * 5000), UnknownNameError, "robot"),
    "pair of no robot": (lambda: pair().counts("arm"), ShapeError, "robot"),
    "pairs of no pairs": (lambda: coordinates.regular_start(robot(), 3), ShapeError, "pairs"),
    "groups": (lambda: conditioning().chosen(["a"]), ShapeError, "group"),
    "sigmas": (lambda: conditioning().sigmas([math.nan] * 3), NotFiniteError, "q"),
    "carry of no robot": (lambda: coordinates.carry("arm", Q, -Q), ShapeError, "robot"),
    "carry too far": (lambda: coordinates.carry(robot(), Q, np.array([1e200, 0.0, 0.0])), RangeError, "q1"),
    "cue too fast": (lambda: coordinates.motion_cue(robot(), pair(), Q, [1e200, 0, 0]), RangeError, "rates"),
    "modes of none": (lambda: coordinates.modes_of(robot(), []), ShapeError, "wanted"),
    "row components": (lambda: coordinates.BodyRows(TIP, translation=[[1.0]]), RangeError, "rows.translation"),
    "point of a set": (lambda: coordinates.OnSphere((0, 0, 0), 1.0).values("x"), ShapeError, "x"),
    "drives": (lambda: coordinates.plot_drives("a.png", 3, 0), ShapeError, "drives"),
    "trees": (lambda: coordinates.tree_sets(["a"]), UnknownNameError, "robot"),
    "analysis of no model": (lambda: analysis.analyse(3, [rows()], [rows()]), ShapeError, "model"),
    "blocks of no robot": (lambda: analysis.joint_blocks(3, [rows()]), ShapeError, "robot"),
    "joint of a model": (lambda: model().support(1e200), ShapeError, "joint"),
    "configuration of a model": (lambda: model().configuration([1.0]), ShapeError, "values"),
    "budget of text": (lambda: analysis.Budget("a"), ShapeError, "branches"),
    "log to nowhere": (lambda: track.save(3, "a"), ShapeError, "log"),
    "path to read": (lambda: track.read_path(3), ShapeError, "path"),
    "time of a path": (lambda: way().sample("now"), ShapeError, "t"),
    "stretched for ever": (lambda: way().stretched(1e55), RangeError, "times"),
    "moving": (lambda: track.MovingObstacle(3, ONE), ShapeError, "MovingObstacle.shape"),
    "clearances": (lambda: track.clearances(robot(), Q, {}, [0.0]), ShapeError, "q"),
    "plan of nothing": (lambda: track.track(3), ShapeError, "plan"),
    "picture of a long path": (lambda: scene().add_path([[0, 0, 0], [1e9, 0, 0]]), RangeError, "Scene.points"),
    "picture of many pixels": (lambda: scene().save("a.png", size=(10**6, 10**6)), RangeError, "Scene.size"),
    "rates from nowhere": (lambda: teleop.RateFile(3), ShapeError, "path"),
    "keys": (lambda: teleop.Keyboard().feed(b"w"), ShapeError, "text"),
    "order to stop": (lambda: teleop.Order(stop="now"), ShapeError, "True or False"),
    "session of nothing": (lambda: teleop.run_session(3, teleop.Keyboard(), Q), ShapeError, "session"),
    "resolver": (lambda: resolvers.TaskPriority().resolve(3), ShapeError, "problem"),
    "rank reduction": (lambda: resolvers.RankReduction(("a",)).resolve(problem()), ShapeError, "given"),
    "DHRow bounds": (lambda: DHRow(lower=1.0, upper=0.0), BoundsError, "DHRow.lower"),
}


@pytest.mark.parametrize("name", CALLS)
def test_refused(name: str) -> None:
    call, error, field = CALLS[name]
    with impatient(), pytest.raises(WbcError) as caught:
        call()
    assert isinstance(caught.value, error), repr(caught.value)
    assert field in str(caught.value)


@pytest.mark.parametrize("unhashable", [[1], {}, np.ones(2), slice(None)])
def test_what_cannot_be_a_name_is_in_nothing(unhashable: Any) -> None:
    assert unhashable not in plain()
    assert unhashable not in compiled()
    assert unhashable not in solvers()


def test_targets_far_away_leak_no_warning() -> None:
    controller = compiled().clone()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for size in (1e50, 1e155, 1e200, 1e308):
            for value in (np.full(3, size), [size, 0.0, -size]):
                controller["hand"].target = value
                assert np.isfinite(controller.step(Q).v).all()


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: wbc.robot.Limits([[1.0], [1.0, 2.0]], *[np.ones(2)] * 4), "position_lower"),
        (lambda: wbc.robots.load("panda", velocity=[[1.0], [1.0, 2.0]]), "velocity"),
        (lambda: wbc.robots.load("panda", effort={"panda_joint1": [[1], "a"]}), "effort"),
        (lambda: wbc.robots.convex_parts(np.eye(3), [[1], "a"]), "triangles"),
        (lambda: wbc.tasks.SelfCollision(corners=1e9, method="sensed"), "corners"),
        (lambda: wbc.tasks.SelfCollision(closest=10**9, method="sensed"), "closest"),
    ],
)
def test_ragged_rows_and_counts_beyond_use(call: Callable[[], object], field: str) -> None:
    with pytest.raises(WbcError, match=field):
        call()
