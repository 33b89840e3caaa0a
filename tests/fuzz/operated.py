"""Good arguments and objects of manual control, analysis, resolvers and runs: what :mod:`tests.fuzz.goods` adds."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from tests.fuzz.arm import DT, MIDDLE, ONE, TIP, Q, robot
from wbc import analysis, coordinates, resolvers, shapes, teleop, track

POSES = [pin.SE3(np.eye(3), np.array([0.6, y, 0.1])) for y in (0.0, 0.05)]
SPHERE = coordinates.OnSphere((0.0, 0.0, 0.0), 0.5)


def _rows() -> coordinates.BodyRows:
    return coordinates.BodyRows(TIP, expressed="world", translation=(0, 1), rotation=())


def _position() -> coordinates.BodyRows:
    return coordinates.BodyRows(TIP, rotation=())


def _pair(joint: str = "joint1", name: str = "one") -> coordinates.CoordinatePair:
    return coordinates.CoordinatePair(_rows(), coordinates.JointRows(joint), name)


def _pairs() -> list[coordinates.CoordinatePair]:
    return [_pair(), _pair("joint3", "two")]


@cache
def _adviser() -> coordinates.Adviser:
    return coordinates.Adviser(robot(), _pairs(), backend="vm")


@cache
def _made_control() -> coordinates.PairController:
    return coordinates.PairController(robot(), _pairs(), DT, backend="vm")


def _control() -> coordinates.PairController:
    control = _made_control()
    control.reset(Q)
    return control


@cache
def _made_session() -> teleop.Teleoperation:
    return teleop.Teleoperation(robot(), (), pairs=_pairs(), backend="vm")


def _session() -> teleop.Teleoperation:
    session = _made_session()
    session.reset(Q)
    return session


@cache
def _model() -> analysis.ExactModel:
    return analysis.ExactModel(robot(), approximate=True)


@cache
def _jacobian() -> analysis.SymbolicJacobian:
    return analysis.symbolic_jacobian(_model(), [_position()])


@cache
def _analysed() -> analysis.Analysis:
    return analysis.analyse(_model(), [_rows()], [coordinates.JointRows("joint1")])


@cache
def _log() -> track.Log:
    return track.track(_plan())


def _plan() -> track.PathRun:
    path = track.SplinePath([0.0, 0.03], POSES)
    return track.PathRun(robot(), TIP, path, "line", Q, DT, {"ball": _moving()}, backend="vm")


def _moving() -> track.MovingObstacle:
    return track.MovingObstacle(
        shapes.Sphere(0.1), pin.SE3(np.eye(3), np.array([2.0, 0.0, 0.0])), np.array([0.0, 0.1, 0.0])
    )


def _problem() -> resolvers.RateProblem:
    return resolvers.RateProblem(np.eye(2, 3), np.ones(2), np.array([[0.0, 1.0, 1.0]]), np.ones(1))


def _scene() -> track.Scene:
    scene = track.Scene(robot())
    scene.add_robot(Q)
    return scene


def _drive() -> coordinates.DriveLog:
    out = coordinates.DriveLog(("one", "two"))
    out.add(0.0, Q, 0.1 * Q, np.ones(2), 0.0, "one")
    out.add(0.1, Q, 0.1 * Q, np.ones(2), 0.0, "one")
    return out


@cache
def _seen() -> teleop.Seen:
    return _session().step(Q, teleop.Order((0.01, 0.0)))


def _session_log() -> teleop.SessionLog:
    log = teleop.SessionLog()
    log.add(0.0, Q, _seen())
    return log


def files(folder: Path) -> None:
    """What some calls read."""
    (folder / "good.csv").write_text("time,pair,r1,r2,r3,r4,r5,r6\n0.0,one,0.01\n0.04,,0.0\n")
    lines = "".join(
        f"{t},{p.translation[0]},{p.translation[1]},{p.translation[2]},0,0,0,1\n" for t, p in enumerate(POSES)
    )
    (folder / "path.csv").write_text("t,x,y,z,qx,qy,qz,qw\n" + lines)
    (folder / "run").mkdir()
    track.save(_log(), folder / "run")


def subjects(folder: Path) -> dict[str, Callable[[], Any]]:
    """name -> a maker of an object whose methods are called."""
    sets = {
        "line": coordinates.OnLine((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        "rows": _rows(),
        "motion": coordinates.SystemMotion(robot()),
        "carried": coordinates.carry(robot(), Q, -Q, _pairs()),
        "closed form": coordinates.closed_form(robot(), _pair("joint3")),
        "cue": coordinates.motion_cue(robot(), _pair(), Q, np.ones(2)),
        "survey": coordinates.survey_pairs(robot(), _pairs(), 5),
        "parts": coordinates.parts(robot()),
        "arm of parts": coordinates.parts(robot()).arms[0],
        "advice": _adviser().advise(Q)[0],
        "analysed": _analysed(),
        "locus": _analysed().locus,
        "blocks": analysis.joint_blocks(robot(), [_rows()])[0],
        "determinant": analysis.factored_determinant(analysis.Exact(_jacobian().ring), _jacobian()),
        "path of poses": track.SplinePath([0.0, 0.03], POSES),
        "moving": _moving(),
        "log": _log(),
        "seen": _seen(),
        "order of rates": teleop.Order((0.01, 0.0)),
        "problem": _problem(),
        "extended": resolvers.ExtendedJacobian(),
        "gradient": resolvers.GradientProjection(np.ones(3)),
        "inverse": resolvers.PseudoInverse(),
        "reduction": resolvers.RankReduction(),
        "priority": resolvers.TaskPriority(),
        "virtual": resolvers.VirtualArms(),
    }
    return {
        **{name: lambda value=value: value for name, value in sets.items() if value is not None},
        "pair of coordinates": _pair,
        "adviser": _adviser,
        "pair controller": _control,
        "automatic": lambda: coordinates.AutomaticPairs(_control(), _adviser()),
        "conditioning": lambda: _adviser().conditioning,
        "drive": _drive,
        "model of analysis": _model,
        "jacobian": _jacobian,
        "spent": lambda: analysis.Budget(2, 0.01),
        "keyboard": teleop.Keyboard,
        "rate file": lambda: teleop.RateFile(folder / "good.csv"),
        "session": _session,
        "session log": _session_log,
        "plan": _plan,
        "scene": _scene,
    }


def probes() -> dict[str, Callable[[], Any]]:
    """Subject -> what must go on working, with the same answer."""
    return {
        "adviser": lambda: _adviser().sigmas(Q),
        "pair controller": lambda: _control().step(Q).v,
        "session": lambda: _session().step(Q, teleop.Order((0.01, 0.0), "one")).step.v,
        "jacobian": lambda: _jacobian().value(Q),
    }


#: (class or function.)parameter -> a good value
GOOD: dict[str, Callable[[Any], Any]] = {
    "coordinate": lambda g: _rows(), "constraint": lambda g: coordinates.JointRows("joint1"), "metric": lambda g: None,
    "coordinates.pair": lambda g: _pair(), "pair": lambda g: _pair(), "limits=": lambda g: True,
    "problem": lambda g: _problem(), "minutes": lambda g: 0.005, "part": lambda g: 0.5, "model": lambda g: _model(),
    "constraints": lambda g: [coordinates.JointRows("joint1")], "q1": lambda g: -Q, "share": lambda g: 0.25,
    "candidates": lambda g: [coordinates.JointRows(f"joint{k}") for k in (1, 2, 3)],
    "algorithm": lambda g: "sub_determinants", "approximate": lambda g: True, "symbols": lambda g: {},
    "certificate": lambda g: None, "progress": lambda g: None, "adviser": lambda g: _adviser(),
    "control": lambda g: _control(), "rates": lambda g: 0.01 * np.ones(2), "near": lambda g: 0.02,
    "exact": lambda g: True, "brakes": lambda g: None, "groups": lambda g: [[_rows()]], "wanted": lambda g: "M1",
    "modes": lambda g: (), "automatic": lambda g: False, "fastest": lambda g: (0.3, 0.07), "current": lambda g: "one",
    "time": lambda g: 0.1, "translation": lambda g: (0, 1), "rotation": lambda g: (), "expressed": lambda g: "world",
    "wanted_rates": lambda g: np.ones(2), "on": lambda g: SPHERE, "normal": lambda g: (0.0, 0.0, 1.0),
    "fastest_return": lambda g: 0.05, "log": lambda g: _session_log(), "session": lambda g: _session(),
    "source": lambda g: teleop.RateFile(g.folder / "good.csv"), "active": lambda g: "one", "realtime": lambda g: False,
    "plan": lambda g: _plan(), "obstacles": lambda g: {"ball": _moving()},
    "gradient": lambda g: np.ones(3), "second": lambda g: np.array([[0.0, 1.0, 1.0]]),
    "second_rates": lambda g: np.ones(1), "text": lambda g: "w", "bodies": lambda g: 7, "detail": lambda g: 0.0,
    "hidden": lambda g: (), "dark": lambda g: (), "stop": lambda g: None, "compiled": lambda g: None,
    "ended": lambda g: None, "state": lambda g: None, "approach": lambda g: 10.0, "holds": lambda g: (),
    "plane": lambda g: None, "label": lambda g: "line", "colour": lambda g: (0.1, 0.2, 0.3), "colours": lambda g: None,
    "pale": lambda g: False, "floor": lambda g: True, "azimuth": lambda g: 0.3, "elevation": lambda g: 0.4,
    "triangles": lambda g: np.ones((1, 3, 3)), "seen": lambda g: _seen(), "drives": lambda g: {"one": _drive()},
    "columns": lambda g: {"t": np.zeros(2)}, "meta": lambda g: {}, "run": lambda g: g.folder / "run",
    "values": lambda g: Q, "latex": lambda g: False, "items": lambda g: (),
    **{f"{c}.task": lambda g: _rows() for c in ("CoordinatePair", "coordinates.smallest_complete_sets")},
    **{f"{c}.pairs": lambda g: _pairs() for c in (
        "Adviser", "PairController", "coordinates.carry", "coordinates.pair_stack",
        "coordinates.regular_start", "coordinates.survey_pairs", "Teleoperation")},
    **{f"analysis.{c}.task": lambda g: [_rows()] for c in (
       "analyse", "analyse_blocks", "certify", "certify_blocks", "screen")},
    **{f"analysis.{c}.rows": lambda g: [_rows()] for c in ("joint_blocks", "symbolic_jacobian")},
    "SystemMotion.rows": lambda g: None, "PairController.units.rows": lambda g: [_rows()],
    "analysis.screen.candidates": lambda g: {f"lock {k}": coordinates.JointRows(f"joint{k}") for k in (1, 2)},
    "analysis.certify.model": lambda g: _model(), "analysis.symbolic_jacobian.axes": lambda g: None,
    "analysis.candidate_rows.name": lambda g: "ssrms", "analysis.published_sets.name": lambda g: "ssrms",
    "coordinates.tree_sets.name": lambda g: coordinates.TREES[0],
    "coordinates.restriction_table.robot": lambda g: "ssrms", "coordinates.restriction_table.mode": lambda g: "M1",
    "coordinates.modes_of.wanted": lambda g: ["M1"], "coordinates.count_pairs.constraints": lambda g: 1,
    "coordinates.plot_drives.path": lambda g: str(g.folder / "drives.png"),
    "coordinates.plot_drives.joint": lambda g: 0, "coordinates.plot_drives.limits": lambda g: (1.0,),
    "coordinates.smallest_complete_sets.certify": lambda g: False, "AxisRows.axis": lambda g: (0.0, 0.0, 1.0),
    "AxisRows.attached": lambda g: "world", "PlaneAngleRows.axis": lambda g: None,
    "PlaneAngleRows.name": lambda g: "psi", "Budget.branches": lambda g: 20, "Budget.minutes": lambda g: 0.01,
    "DriveLog.names": lambda g: ("one",), "DriveLog.time": lambda g: 0.1, "DriveLog.sigma": lambda g: np.ones(2),
    "DriveLog.miss": lambda g: 0.0, "PairController.name": lambda g: "two",
    "PairController.switch.name": lambda g: "two", "PairController.met.v": lambda g: 0.1 * Q,
    "PairController.prescribe.rates": lambda g: np.ones(1), "Conditioning.chosen.groups": lambda g: [0],
    "Conditioning.group": lambda g: 0, "Conditioning.many.states": lambda g: np.array([Q, -Q]),
    "PairSurvey.part": lambda g: 0.5, "Arm.first": lambda g: 0, "ExactModel.joint": lambda g: 1,
    "ExactModel.name": lambda g: TIP, "ExactModel.seen_from": lambda g: "world", "SymbolicJacobian.q": lambda g: Q,
    "Order.rates": lambda g: (0.01, 0.0), "Order.pair": lambda g: "one", "Order.stop": lambda g: False,
    "Teleoperation.order": lambda g: teleop.Order((0.01, 0.0)), "Teleoperation.items": lambda g: (),
    "Teleoperation.acceleration": lambda g: 5.0, "RateFile.path": lambda g: str(g.folder / "good.csv"),
    "teleop.run_session.seconds": lambda g: 0.04, "SessionLog.path": lambda g: str(g.folder / "session.csv"),
    "SessionLog.names": lambda g: ("one", "two"), "Keyboard.names": lambda g: ["one", "two"],
    "Keyboard.units": lambda g: ["m", "m"], "RateFile.names": lambda g: ["one", "two"],
    "RateFile.units": lambda g: ["m", "m"], "RateFile.time": lambda g: 0.0,
    "PseudoInverse.weight": lambda g: np.eye(3), "RankReduction.given": lambda g: None,
    "RankReduction.rates": lambda g: None, "RateProblem.task": lambda g: np.eye(2, 3),
    "RateProblem.wanted": lambda g: np.ones(2), "SplinePath.times": lambda g: [0.0, 0.03],
    "SplinePath.poses": lambda g: POSES, "SplinePath.t": lambda g: 0.01, "SplinePath.duration": lambda g: 0.05,
    "MovingObstacle.pose": lambda g: _moving().pose, "MovingObstacle.velocity": lambda g: np.zeros(3),
    "MovingObstacle.t": lambda g: 0.1,
    "PathRun.path": lambda g: track.SplinePath([0.0, 0.03], POSES), "PathRun.start": lambda g: Q,
    "track.clearances.q": lambda g: np.array([Q, -Q]), "track.clearances.t": lambda g: np.array([0.0, 0.1]),
    "track.self_clearances.q": lambda g: np.array([Q, -Q]), "Log.units": lambda g: {"t": "s"},
    "Log.name": lambda g: "t", "track.save.log": lambda g: _log(), "track.save.kind": lambda g: "parquet",
    "track.save.folder": lambda g: g.folder / "new run", "track.load.run": lambda g: g.folder / "run",
    "track.preset.name": lambda g: next(iter(track.PRESETS)), "track.preset.start": lambda g: ONE,
    "track.preset.size": lambda g: 0.1, "track.read_path.file": lambda g: g.folder / "path.csv",
    "Scene.file": lambda g: g.folder / "scene.png", "Scene.size": lambda g: (96, 60), "Scene.pieces": lambda g: (),
    "Scene.points": lambda g: np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]), "Scene.radius": lambda g: 0.006,
    "JointRows.name": lambda g: "", "PointRows.frame": lambda g: MIDDLE, "closed.q": lambda g: Q,
}  # fmt: skip
