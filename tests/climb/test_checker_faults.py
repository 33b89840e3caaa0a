"""Faults of hands, wrenches, clocks and links that the checker of climbing finds; it shares no code with the loop."""

from __future__ import annotations

import ast
import dataclasses
import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.climb.checker
from tests.climb.by_hand import TRIPODS, gait
from tests.climb.test_operator import walked
from wbc.climb import ContactPlan, GripHand
from wbc.climb.checker import CheckRules, check
from wbc.climb.climber import Climber
from wbc.climb.loop import ClimbLoop
from wbc.climb.loop.records import WRENCH
from wbc.log import Log
from wbc.shapes import PlacedShape, Sphere

Columns = dict[str, np.ndarray]
Fault = Callable[[Columns, Climber], None]
#: Ticks of the first swing, and a joint of the limb in the air
ALOFT, LONGER, KNEE = slice(50, 51), slice(47, 53), "q.8"
#: What the checker may take from the package: what a log, a robot, a scene and shapes are
SHARED = {
    "wbc.climb.climber", "wbc.climb.scene", "wbc.clearance", "wbc.errors", "wbc.lazy", "wbc.linear_program",
    "wbc.log", "wbc.multibody", "wbc.shapes", "wbc.validation",
}  # fmt: skip


@functools.cache
def logged(name: str) -> tuple[ContactPlan, Log]:
    plan = gait(TRIPODS) if name == "hexapod" else walked()
    return plan, ClimbLoop(plan, backend="vm").run(most=4.0).log


def _with_wrenches(log: Log, plan: ContactPlan) -> Columns:
    """Each foot that holds bears its share of the weight."""
    weight = 9.81 * pin.computeTotalMass(plan.climber.robot.model)
    held = log.array("contact") >= 0
    out = dict(log.columns)
    for k, limb in enumerate(plan.climber.limbs):
        for axis in WRENCH:
            out[f"wrench.{limb.name}.{axis}"] = np.zeros(len(log))
        out[f"wrench.{limb.name}.fz"] = np.where(held[:, k], weight / held.sum(axis=1), 0.0)
    return out


def _joint(climber: Climber, limb: int, back: int) -> str:
    """Column of the joint so many before the last one of a limb."""
    return f"q.{int(climber.robot.position_index[climber.joints(limb)[-1 - back]])}"


def _changed(names: str, ticks: slice, change: Callable[[np.ndarray], object]) -> Fault:
    """What takes the place of the values of columns at some ticks."""

    def fault(c: Columns, climber: Climber) -> None:
        for name in names.split():
            c[name][ticks] = change(c[name][ticks])

    return fault


def _added(name: str, ticks: slice, more: object) -> Fault:
    """The values of a column at some ticks are more."""
    return _changed(name, ticks, lambda values: values + more)


def _tilted(c: Columns, climber: Climber) -> None:
    c[_joint(climber, 1, 1)] += 0.05


def _slid(c: Columns, climber: Climber) -> None:
    c[f"wrench.{climber.limbs[3].name}.fx"][30:40] = 0.7 * c[f"wrench.{climber.limbs[3].name}.fz"][30:40]


def _pulled(c: Columns, climber: Climber) -> None:
    c[f"wrench.{climber.limbs[3].name}.fz"][30:40] *= -1.0


def _lost_ticks(c: Columns, climber: Climber) -> None:
    for name, values in c.items():
        c[name] = np.delete(values, slice(100, 103))


def _backwards(c: Columns, climber: Climber) -> None:
    c["t"][100] = c["t"][98]


def _hidden_loss(c: Columns, climber: Climber) -> None:
    """Ticks are left out and the clock goes on as if they were not."""
    clock = c["t"].copy()
    for name, values in c.items():
        c[name] = np.delete(values, slice(60, 80))
    c["t"] = clock[:-20]


def _folded(c: Columns, climber: Climber) -> None:
    """A limb in the air is in another one."""
    aloft = int(np.flatnonzero(c["contact.limb1"] < 0)[0])
    for dof in climber.joints(0):
        c[f"q.{int(climber.robot.position_index[dof])}"][aloft : aloft + 3] += (2.4, -1.0, 1.5)[dof % 3]


FAULTS = (
    ("walker", _tilted, "closed contact turned"), ("hexapod", _slid, "contact wrench outside its cone"),
    ("hexapod", _pulled, "contact wrench outside its cone"), ("hexapod", _lost_ticks, "step of time"),
    ("walker", _backwards, "step of time"), ("hexapod", _hidden_loss, "joint's rate"),
    ("walker", _added("q.0", slice(100, None), 0.01), "closed contact off its foothold"),
    ("hexapod", _changed("contact.limb2", slice(10, 20), lambda _: 8), "closed contact off its foothold"),
    ("hexapod", _folded, "clearance of links"), ("hexapod", _added("t", slice(50, None), 0.003), "step of time"),
    ("hexapod", _changed(KNEE, slice(None), lambda _: 2.5), "joint beyond its limit"),
    ("hexapod", _added("q.7", slice(50, None), 0.1), "joint's rate"),
    ("hexapod", _added("q.7", slice(50, None), 0.02), "joint's acceleration"),
    ("hexapod", _changed("q.0", slice(None), lambda x: x + np.linspace(0.0, 0.006, len(x)).clip(max=0.0015)),
     "closed contact slips"),
    ("hexapod", _added("q.1", slice(None), 0.0025), "closed contact off its foothold"),
    ("hexapod", _changed("contact.limb1", ALOFT, lambda _: 6), "closed contact off its foothold"),
    ("hexapod", _changed("contact.limb2 contact.limb4 contact.limb6", ALOFT, lambda _: -1),
     "contacts bear the robot at rest"),
    ("hexapod", _changed("contact.limb1", ALOFT, lambda _: 1), "foothold that is another's"),
    ("hexapod", _added(KNEE, LONGER, 0.4), "clearance of bodies"),
    ("hexapod", _added(KNEE, LONGER, 0.4), "contact's point in a body"),
)  # fmt: skip
#: Those of a log without wrenches
RULES = {rule for *_, rule in FAULTS} - {"contact wrench outside its cone"}


@functools.cache
def honest(name: str, wrenches: bool) -> Log:
    """A log that keeps all rules."""
    plan, log = logged(name)
    out = dataclasses.replace(log, columns=_with_wrenches(log, plan) if wrenches else log.columns)
    report = check(out, plan.climber, plan.scene)
    assert report.clean, str(report)
    looked = {finding.rule: finding.count for finding in report.findings}
    assert name == "walker" or wrenches or looked.keys() >= RULES
    assert min(count for rule, count in looked.items() if rule != "closed contact turned") > 0, looked
    return out


@pytest.mark.parametrize(
    ("name", "fault", "rule"), FAULTS, ids=[f"{rule} {k}" for k, (_, _, rule) in enumerate(FAULTS)]
)
def test_a_fault_is_found(name: str, fault: Fault, rule: str) -> None:
    plan, log = logged(name)[0], honest(name, "wrench" in rule)
    planted = {name: values.copy() for name, values in log.columns.items()}
    fault(planted, plan.climber)
    report = check(dataclasses.replace(log, columns=planted), plan.climber, plan.scene)
    assert rule in {finding.rule for finding in report.violations}, str(report)


def _lost(c: Columns, climber: Climber) -> None:
    """A limb goes on holding what has vanished."""


ASKED = (
    (_lost, "held after it vanished"), (_added("q.0", slice(60, 80), np.linspace(0.0, 0.012, 20)), "body's speed"),
    (_added("q.5", slice(60, 80), np.linspace(0.0, 0.01, 20)), "body's turn rate"),
    (_added("q.0", slice(60, None), 0.0005), "jump of the body's speed"),
    (_added("q.5", slice(60, None), 0.0005), "jump of the body's turn rate"),
)  # fmt: skip


@pytest.mark.parametrize(("fault", "rule"), ASKED, ids=[rule for _, rule in ASKED])
def test_what_was_not_asked_for_is_found(fault: Fault, rule: str) -> None:
    plan, log = logged("hexapod")
    body = np.linalg.norm(np.diff(log.array("q")[:, :3], axis=0), axis=1).max() / log.meta["period"]
    rules = CheckRules(speed=float(body), turn_rate=0.01, jump=0.02, jump_turn=0.02)
    # What limb1 left first has vanished since, and in the fault what limb2 holds
    held, free = int(log["contact.limb2"][10]), int(log["contact.limb1"][0])
    since = float(log["t"][np.flatnonzero((log.array("contact") == free).any(axis=1))[-1]])
    kept = dataclasses.replace(log, tables={**log.tables, "presence": np.array([[free, since, 0.0]])})
    assert check(kept, plan.climber, plan.scene, rules).clean, str(check(kept, plan.climber, plan.scene, rules))
    planted = {name: values.copy() for name, values in log.columns.items()}
    fault(planted, plan.climber)
    gone = np.array([[held, 0.05, 0.0] if fault is _lost else [free, since, 0.0]])
    told = dataclasses.replace(kept, columns=planted, tables={**log.tables, "presence": gone})
    found = {finding.rule: finding for finding in check(told, plan.climber, plan.scene, rules).violations}
    assert rule in found, str(check(told, plan.climber, plan.scene, rules))
    if fault is _lost:
        assert found[rule].where == f"limb2 on {plan.scene.footholds[held].id}"
        back = np.vstack([gone, [[held, 0.06, 1.0]]])
        again = dataclasses.replace(told, tables={**log.tables, "presence": back})
        wrong = {f.rule: f.worst for f in check(again, plan.climber, plan.scene, rules).violations}
        assert wrong[rule] < 0.011


def test_a_hand_is_deep_near_footholds_of_its_way_alone() -> None:
    """A hand in the air as deep as where it holds, over a foothold that it neither leaves nor comes to."""
    plan, log = logged("walker")
    limb, (first, last) = next(
        (k, (ticks[0], ticks[-1])) for k in range(len(plan.climber.limbs))
        if len(ticks := np.flatnonzero(log.array("contact")[:, k] < 0))
    )  # fmt: skip
    middle, name = (first + last) // 2, plan.climber.limbs[limb].name
    tip = plan.climber.contact_pose(log.array("q")[middle], limb)
    left = plan.scene.footholds[int(log[f"contact.{name}"][first - 1])]
    normal = left.pose.rotation[:, 2]
    below, center = (pin.SE3(left.pose.rotation, tip.translation - d * normal) for d in (0.004, 0.024))
    there = dataclasses.replace(left, id="passed", pose=below, on="knob")
    bodies = {**plan.scene.bodies, "knob": PlacedShape(Sphere(0.02), center)}
    scene = dataclasses.replace(plan.scene, footholds=[*plan.scene.footholds, there], bodies=bodies)
    columns = {column: values[[middle, middle, middle]] for column, values in log.columns.items()}
    columns["t"] = log.meta["period"] * np.arange(3.0)
    # It comes straight down from where it is said to hold what it left
    columns[f"contact.{name}"] = np.array([plan.scene.footholds.index(left), -1, -1])
    for axis in range(3):
        columns[f"q.{axis}"][0] += 0.3 * normal[axis]
    for aim, clear in ((-1, False), (len(plan.scene.footholds), True)):
        columns[f"aim.{name}"] = np.array([-1, aim, aim])
        report = check(dataclasses.replace(log, columns=columns), plan.climber, scene)
        deep = [finding.where for finding in report.violations if finding.rule == "clearance of bodies"]
        assert (not deep) is clear, deep


def test_a_hand_that_fixes_its_turn_must_keep_it() -> None:
    plan, log = logged("walker")
    stiff = dataclasses.replace(plan.climber, limbs=tuple(
        dataclasses.replace(limb, contact=GripHand()) for limb in plan.climber.limbs))  # fmt: skip
    # Of hands that may roll the last joint of a closed one turns as the body goes
    rolled = [f.rule for f in check(log, stiff, plan.scene).violations]
    assert rolled == ["closed contact turned"]


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_links_that_pass_each_other_between_two_ticks_are_found(share: float) -> None:
    """A grain on the way of a foot, at shares of the way between two ticks."""
    plan, log = logged("hexapod")
    machine, q = plan.climber, log.array("q")
    columns = {name: values[::10] for name, values in log.columns.items()}
    few = dataclasses.replace(log, columns=columns, meta={**log.meta, "period": 0.1})
    k = int(np.flatnonzero(log["contact.limb1"] < 0)[0]) // 10 + 1
    a, b = q[10 * k], q[10 * (k + 1)]
    at = pin.integrate(machine.robot.model, a, share * pin.difference(machine.robot.model, a, b))
    grain = PlacedShape(Sphere(2e-4), pin.SE3(np.eye(3), machine.contact_pose(at, 0).translation))
    scene = dataclasses.replace(plan.scene, bodies={**plan.scene.bodies, "grain": grain})
    violated = {finding.rule: finding.where for finding in check(few, machine, scene).violations}
    assert violated["clearance of bodies"] == "limb1_link3 and grain"


def test_a_limb_that_leaves_its_foothold_as_the_log_begins_may_be_as_deep_as_it_was() -> None:
    plan, log = logged("hexapod")
    lifted = int(np.flatnonzero(log["contact.limb1"] < 0)[0])
    later = dataclasses.replace(log, columns={name: values[lifted:] for name, values in log.columns.items()})
    assert check(later, plan.climber, plan.scene).clean
    deeper = {name: values.copy() for name, values in later.columns.items()}
    deeper["q.2"] -= 0.004
    found = check(dataclasses.replace(later, columns=deeper), plan.climber, plan.scene).violations
    assert "contact's point in a body" in {finding.rule for finding in found}


def test_the_checker_shares_nothing_with_planner_and_loop() -> None:
    taken = set[str]()
    for file in Path(wbc.climb.checker.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("wbc"):
                named = [f"wbc.{alias.name}" for alias in node.names] if node.module == "wbc" else [node.module]
                taken.update(named)
            if isinstance(node, ast.Import):
                taken |= {alias.name for alias in node.names if alias.name.startswith("wbc")}
    assert {name for name in taken if not name.startswith("wbc.climb.checker")} <= SHARED
