"""Mimic joints become couplings or are reduced; locked joints leave the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc.robots
from tests.models import placement
from tests.refusals import assert_refused
from tests.repeats import repeats
from tests.robots.files import DATA, example, joints
from wbc.errors import BoundsError, NotFiniteError, RangeError, ShapeError, UnknownNameError

RECIPES = {recipe.name: recipe for recipe in wbc.robots.table() if not recipe.problem}
WITH_MIMICS = [
    name for name, r in RECIPES.items() if any(j.find("mimic") is not None for j in joints(example(r.file)).values())
]


@pytest.mark.parametrize("name", [n for n in WITH_MIMICS if RECIPES[n].lock])
def test_table_locks_reduce_both_ends(name: str) -> None:
    robot, whole = wbc.robots.load(name, shapes="none"), wbc.robots.load(name, lock=(), shapes="none")
    assert robot.couplings == ()
    assert whole.nv - robot.nv >= 2
    assert set(robot.joint_names) < set(whole.joint_names)


def test_misspelt_leader_chain_and_lost_follower() -> None:
    robot = wbc.robots.load(DATA / "misspelt.urdf")
    names = robot.dof_names
    found = {names[c.follower]: (names[c.leader], c.ratio, c.offset) for c in robot.couplings}
    assert found["follow"] == ("lead", -0.5, 0.25)
    assert found["chain"] == ("lead", -1.0, pytest.approx(0.6))
    assert "lost (of nobody)" in robot.notes["mimic"]
    assert np.isinf(robot.limits.position_upper[robot.dofs("lost")]).all()
    assert "lost" in robot.notes["position"]
    assert np.isinf(robot.limits.velocity[robot.dofs("follow")]).all()
    assert "follow" in robot.notes["velocity"]


def test_locking_one_end_of_a_pair_locks_the_other() -> None:
    robot = wbc.robots.load(DATA / "misspelt.urdf", lock={"follow": 0.5})
    assert robot.joint_names == ("lost",)
    one = placement(robot, "one", robot.neutral).rotation
    np.testing.assert_allclose(one, pin.utils.rotate("z", -0.5), atol=1e-12)


def test_what_followers_leave_of_a_leaders_range_is_said_and_nothing_is_refused(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Random limits, ratios and offsets, beside a leader's values one by one."""
    rng, ends = np.random.default_rng(3), {"cut": 0, "refused": 0, "whole": 0}
    for _ in range(repeats(30)):
        low, high = np.sort(rng.uniform(-2.0, 2.0, (2, 2)), axis=0).tolist()
        ratio, offset = float(rng.uniform(0.3, 2.0) * rng.choice([-1.0, 1.0])), rng.uniform(-0.5, 0.5)
        joints = "".join(
            f'<link name="l{k}"/><joint name="{name}" type="revolute"><parent link="root"/><child link="l{k}"/>'
            f'<limit lower="{low[k]!r}" upper="{high[k]!r}" velocity="1" effort="1"/>{mimic}</joint>'
            for k, (name, mimic) in enumerate(
                {"lead": "", "follow": f'<mimic joint="lead" multiplier="{ratio!r}" offset="{offset!r}"/>'}.items()
            )
        )
        (tmp_path / "pair.urdf").write_text(f'<robot name="pair"><link name="root"/>{joints}</robot>')
        values = np.linspace(low[0], high[0], 20001)
        followed = ratio * values + offset
        left = values[(followed >= low[1]) & (followed <= high[1])]
        caplog.clear()
        if not left.size:
            with pytest.raises(BoundsError, match=r"pair\.urdf: limits of lead: no value is left: follow follows it"):
                wbc.robots.load(tmp_path / "pair.urdf")
            # The caller may give limits that leave something
            wbc.robots.load(tmp_path / "pair.urdf", position_lower=-9.0, position_upper=9.0)
            ends["refused"] += 1
            continue
        robot = wbc.robots.load(tmp_path / "pair.urdf")
        kept, at = robot.coupled(robot.limits), robot.dofs("lead").start
        np.testing.assert_allclose([kept.position_lower[at], kept.position_upper[at]], left[[0, -1]], atol=1e-3)
        cut = max(left[0] - low[0], high[0] - left[-1])
        told = f"lead has {kept.position_lower[at]:.6g} to {kept.position_upper[at]:.6g} of its"
        if abs(cut - 0.01) > 1e-3:
            assert (told in caplog.text) == (told in robot.notes.get("mimic", "")) == (cut > 0.01)
            ends["cut" if cut > 0.01 else "whole"] += 1
    assert min(ends.values()) > 0, ends


@pytest.mark.parametrize("offset", [-0.2, 0.9])
def test_a_ratio_of_0_holds_a_joint_within_its_range_or_the_file_is_refused(offset: float) -> None:
    bodies = "".join(
        f'<body><joint name="{name}" range="-.5 .5"/><geom size=".1"/></body>' for name in ("lead", "follow")
    )
    text = f"""<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody><equality>
<joint joint1="follow" joint2="lead" polycoef="{offset} 0 0 0 0"/></equality></mujoco>"""
    if offset > 0.5:
        with pytest.raises(BoundsError, match=r"limits of follow: no value is left: it stands at 0.9, whatever lead"):
            wbc.robots.load(text)
        return
    robot = wbc.robots.load(text)
    assert robot.neutral[robot.dofs("follow")] == [offset]


def test_bad_locks() -> None:
    with pytest.raises(UnknownNameError) as caught:
        wbc.robots.load("panda", lock=["panda_joint33"])
    assert caught.value.choices[0] in ("panda_joint3", "panda_finger_joint1", "panda_joint1")
    assert_refused(lambda: wbc.robots.load("panda", lock=["wheel_*"]), UnknownNameError, "")
    assert_refused(lambda: wbc.robots.load("talos", lock=["root_joint"]), UnknownNameError, "")
    assert_refused(lambda: wbc.robots.load("panda", lock=3), ShapeError, "")
    assert_refused(lambda: wbc.robots.load("panda", lock={"panda_joint3": float("nan")}), NotFiniteError, "")
    with pytest.raises(RangeError, match="follows panda_finger_joint1"):
        wbc.robots.load("panda", lock={"panda_finger_joint1": 0.01, "panda_finger_joint2": 0.02})
    with pytest.raises(ShapeError, match="several degrees of freedom"):
        wbc.robots.load(DATA / "crawler.xml", lock={"ball": 0.1})


def test_a_ball_joint_is_locked_as_it_is() -> None:
    whole, robot = wbc.robots.load(DATA / "crawler.xml"), wbc.robots.load(DATA / "crawler.xml", lock="ball")
    assert (robot.nq, robot.nv) == (whole.nq - 4, whole.nv - 3)


def test_a_model_with_pinocchios_own_mimic_joint_has_one_degree_of_freedom_less() -> None:
    source = str(example(RECIPES["panda"].file))
    robot = wbc.robots.load(pin.buildModelFromUrdf(source, True))
    assert (robot.nq, robot.nv, robot.couplings) == (8, 8, ())
    assert robot.dof_names[-1] == "panda_finger_joint1"
    assert wbc.robots.load(robot.model, lock="panda_joint3").nv == 7


def test_a_robot_of_which_all_is_locked_has_no_motor() -> None:
    robot = wbc.robots.load("panda", lock="*", shapes="none")
    assert robot.motor_jacobian(robot.neutral).shape == (0, 0)
    assert robot.at_motors(robot.neutral, []).shape == (0,)
