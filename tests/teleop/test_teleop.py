"""Sessions of an operator: orders from programs, files and keys; what is refused; what stays where it is."""

from __future__ import annotations

import os
import pty
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from tests.models import frame_jacobian, placement
from wbc.coordinates import BodyRows, CoordinatePair, JointRows, MissingPartError, expressions
from wbc.errors import NotFiniteError, RangeError, ShapeError, UnknownNameError
from wbc.robots import load, operator_arm
from wbc.teleop import Keyboard, Order, RateFile, RateFileError, SessionLog, Teleoperation, run_session
from wbc.teleop.keyboard import HELD
from wbc.teleop.session import STALE
from wbc.terminal import NoTerminalError

Q = np.array([0.3, 0.5, -0.7, 1.1])


@pytest.fixture(scope="module")
def compiled() -> Teleoperation:
    return Teleoperation("spherical_4r", acceleration=0.5, seconds=0.5)


@pytest.fixture
def session(compiled: Teleoperation) -> Teleoperation:
    compiled.control.switch(compiled.names[0], 0.0)
    compiled.reset(Q)
    return compiled


def place(session: Teleoperation, q: np.ndarray, frame: str = "tip") -> pin.SE3:
    return placement(session.robot, frame, q)


def test_rates_hold_until_they_are_stale(session: Teleoperation) -> None:
    q = Q
    for _ in range(20):
        seen = session.step(q, Order((0.05, 0.0, 0.0)))
        q = q + 0.02 * seen.step.v
    rate = session.control.rates(Q)[session.control.pair.task[0]]
    np.testing.assert_allclose((rate @ seen.step.v), (0.05, 0.0, 0.0), atol=1e-2)
    assert (seen.active, seen.blending, seen.stale) == ("tip | alpha", False, False)
    assert seen.advised == "tip | alpha"
    count = 0
    while not (seen := session.step(q)).stale:
        count += 1
        q = q + 0.02 * seen.step.v
    assert count == round(STALE / 0.02)
    for _ in range(60):
        q = q + 0.02 * session.step(q).step.v
    assert np.abs(session.step(q).step.v).max() < 1e-9


def test_a_file_drives_and_changes_pairs(session: Teleoperation, tmp_path: Path) -> None:
    file = tmp_path / "orders.csv"
    lines = ["time,pair,r1,r2,r3,r4,r5,r6", "0,tip | alpha,0.05", "", "1,alpha | tip", "2.0,,0.05", "5"]
    file.write_text("\n".join(lines))
    source, told = RateFile(file), []
    log = run_session(session, source, Q, progress=lambda time, seen: told.append((time, seen.active)))
    assert source.seconds == 5.0
    assert len(log.time) == len(told) == 250
    assert (log.active[49], log.active[51]) == ("tip | alpha", "alpha | tip")
    assert set(log.status) == {"solved"}
    held, last = (place(session, log.q[k]).translation for k in (80, 249))
    assert np.abs(held - last).max() < 1e-6
    assert np.abs(log.q[249] - log.q[100]).max() > 0.05
    change = np.abs(np.diff(log.v, axis=0)).max() / 0.02
    assert change < 0.5 + 1e-6
    written = log.write(tmp_path / "out" / "log.csv", session.robot.dof_names).read_text().splitlines()
    assert len(written) == 251
    assert written[0].startswith("time,pair,status,sigma,kept,advised,lost,why,asked 1,")


def test_keys_that_are_held_and_pairs_by_keys(session: Teleoperation) -> None:
    keys, units = Keyboard(linear=0.04), ("m", "m", "m")
    keys.feed("wd")
    assert keys.order(0.0, session.names, "tip | alpha", units).rates == (0.04, -0.04, 0.0)
    assert keys.order(HELD - 0.01, session.names, "tip | alpha", units).rates[0] == 0.04
    assert keys.order(HELD, session.names, "tip | alpha", units).rates == (0.0, 0.0, 0.0)
    keys.feed("+s")
    assert keys.order(1.0, session.names, "tip | alpha", units).rates[0] == -0.05
    keys.feed("u")
    assert keys.order(1.1, session.names, "tip | alpha", units).rates[1:] == (0.0, 0.0)
    keys.feed("nn")
    order = keys.order(1.2, session.names, "tip | alpha", units)
    assert (order.pair, order.rates) == (session.names[2], (0.0, 0.0, 0.0))
    keys.feed("p")
    assert keys.order(1.2, session.names, "tip | alpha", units).pair == session.names[-1]
    keys.feed(" ")
    assert keys.order(1.3, session.names, "tip | alpha", units).stop
    keys.feed("+" * 50)
    keys.order(1.4, session.names, "tip | alpha", units)
    assert keys.factor == 4.0
    keys.feed("wq")
    with pytest.raises(StopIteration):
        keys.order(1.5, session.names, "tip | alpha", units)


def test_a_terminal_is_read_and_left_as_it_was(session: Teleoperation, monkeypatch: pytest.MonkeyPatch) -> None:
    import termios

    outer, inner = pty.openpty()
    with os.fdopen(inner) as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        before = termios.tcgetattr(inner)
        with Keyboard().terminal() as keys:
            assert termios.tcgetattr(inner) != before
            os.write(outer, b"w")
            log = run_session(session, _quit_after(keys, outer, 30), Q, realtime=True)
        assert termios.tcgetattr(inner) == before
    os.close(outer)
    assert 29 <= len(log.time) < 40
    assert np.abs(log.v[20]).max() > 1e-3
    with Path(os.devnull).open() as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        with pytest.raises(NoTerminalError, match="no terminal"), Keyboard().terminal():
            pass


def _quit_after(keys: Keyboard, terminal: int, ticks: int) -> Any:
    class Source:
        count = 0

        def order(self, *given: Any) -> Order:
            self.count += 1
            if self.count == ticks:
                os.write(terminal, b"q")
            return keys.order(*given)

    return Source()


def test_stop_brings_everything_to_rest(session: Teleoperation) -> None:
    q = Q
    for _ in range(30):
        q = q + 0.02 * session.step(q, Order((0.1, 0.0, 0.0))).step.v
    for _ in range(60):
        q = q + 0.02 * session.step(q, Order(stop=True)).step.v
    assert np.abs(session.step(q).step.v).max() < 1e-9


def test_pairs_change_by_themselves_where_that_is_wanted() -> None:
    auto = Teleoperation("spherical_4r", ["M4"], automatic=True, acceleration=1.0, seconds=0.3, backend="vm")
    q = np.array([0.3, 1.5, -0.7, 1.1])
    auto.reset(q)
    for _ in range(20):
        seen = auto.step(q, Order((0.01, 0.0, 0.0)))
        q = q + 0.02 * seen.step.v
    assert seen.active == seen.advised
    assert seen.active in ("tip | beta", "tip | joint1")


def test_brakes_hold_all_but_one_chain() -> None:
    """Of 15 joints those of the first arm move; then its hand is turned by one joint alone."""
    pairs = (CoordinatePair(BodyRows("arm1_tip"), [JointRows(f"arm1_joint{k}") for k in (1,)] + _rest(), "arm 1"),)
    session = Teleoperation("spdm", [], pairs=pairs, backend="vm")
    arm = [0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9]
    q = start = np.concatenate(([0.2], arm, arm))
    session.reset(q)
    for _ in range(25):
        q = q + 0.02 * session.step(q, Order((0.01, 0.0, 0.0, 0.0, 0.01, 0.0))).step.v
    moved = [k for k, name in enumerate(session.robot.dof_names) if abs(q[k] - start[k]) > 1e-9]
    assert [session.robot.dof_names[k] for k in moved] == [f"arm1_joint{k}" for k in range(2, 8)]


def _rest() -> list[JointRows]:
    return [JointRows(f"arm2_joint{k}") for k in range(1, 8)] + [JointRows("body_joint")]


def test_bad_orders_change_nothing(session: Teleoperation) -> None:
    for order, error in (
        (Order((0.0, 0.0, 0.0, 0.01)), RangeError),
        (Order((0.5,)), RangeError),
        (Order(pair="tip | alfa"), UnknownNameError),
        (Order((0.0, 0.1), pair="alpha | tip"), RangeError),
    ):
        with pytest.raises(error):
            session.step(Q, order)
    assert session.control.active == "tip | alpha"
    assert np.abs(session.step(Q).step.v).max() < 1e-12
    for rates, error in (
        ((0.0,) * 7, RangeError),
        ((np.nan,), NotFiniteError),
        ("fast", ShapeError),
        (1.0, ShapeError),
    ):
        with pytest.raises(error):
            Order(rates)  # type: ignore[arg-type]
    with pytest.raises(ShapeError):
        session.step(Q[:3])


def test_bad_sessions_and_files(tmp_path: Path) -> None:
    with pytest.raises(MissingPartError):
        Teleoperation("spherical_4r", ["M7"])
    with pytest.raises(UnknownNameError):
        Teleoperation("srms")
    with pytest.raises(ShapeError):
        Teleoperation("ssrms", [])
    both = CoordinatePair([BodyRows("tip"), JointRows("joint1")], JointRows("joint2"))
    with pytest.raises(RangeError, match="at most 6"):
        Teleoperation("ssrms", [], pairs=[both])
    head = "time,pair,r1,r2,r3,r4,r5,r6\n"
    for text in (
        "",
        "time,pair\n",
        head,
        head + "a,,1\n",
        head + "0,,x\n",
        head + "1\n1\n",
        head + "-1\n",
        head + "0,,nan\n",
    ):
        file = tmp_path / "bad.csv"
        file.write_text(text)
        with pytest.raises(RateFileError):
            RateFile(file)
    with pytest.raises(RateFileError, match="no such file"):
        RateFile(tmp_path / "none.csv")


#: Beside joint 2 at 90 degrees, where the lock of the yaw joint loses its rank
BESIDE = np.array([0.3, np.pi / 2 - 0.012, -0.5, 1.2, 0.7, -0.6, 0.9])
#: Away from all loci
ELBOWED = np.array([0.3, 0.4, -0.5, 1.2, 0.7, -0.6, 0.9])


@pytest.fixture(scope="module")
def station() -> Teleoperation:
    return Teleoperation("ssrms", ["M1", "M8"], seconds=0.2, acceleration=1.0, backend="vm")


def test_what_is_lost_is_told_with_the_reason_and_a_better_pair(station: Teleoperation) -> None:
    """Beside the locus of the yaw joint's lock most of a command is lost, and told; another pair loses nothing."""
    robot, q = station.robot, BESIDE
    scale = np.array([1.0 / robot.characteristic_length] * 3 + [1.0] * 3)
    J = frame_jacobian(robot, "tip", BESIDE)
    worst = np.linalg.svd(np.vstack([scale[:, None] * J, np.eye(7)[1]]))[0][:6, -1] / scale
    rates = tuple(0.02 * worst / np.abs(worst[:3]).max())
    station.reset(q)
    for k in range(60):
        seen = station.step(q, Order(rates, pair="xi | joint2" if k == 0 else None))
        np.testing.assert_allclose(seen.met, frame_jacobian(robot, "tip", q) @ seen.step.v, atol=1e-12)
        np.testing.assert_array_equal(seen.asked, rates)
        lost = np.linalg.norm(scale * (seen.asked - seen.met)) / np.linalg.norm(scale * seen.asked)
        assert seen.lost == pytest.approx(lost, abs=1e-12)
        assert seen.lost < 1e-3 or seen.why
        q = q + station.control.dt * seen.step.v
    assert (seen.active, seen.blending) == ("xi | joint2", False)
    assert seen.sigma < 0.01
    assert seen.kept < 0.2
    assert seen.lost > 0.3
    assert any("this pair is near a locus of its own, sigma" in text for text in seen.why)
    assert seen.advised.startswith("xi | ")
    assert seen.advised != "xi | joint2"
    station.reset(BESIDE)
    q = BESIDE
    for k in range(60):
        better = station.step(q, Order(rates, pair=seen.advised if k == 0 else None))
        q = q + station.control.dt * better.step.v
    assert better.lost < 1e-2


@pytest.mark.parametrize(
    ("kind", "limits"),
    [
        ("acceleration", {}),
        ("rate", {"velocity": 0.004}),
        ("position", {"position_lower": ELBOWED - 0.005, "position_upper": ELBOWED + 0.005}),
    ],
)
def test_what_is_late_is_told_apart_from_what_limits_take(kind: str, limits: dict[str, Any]) -> None:
    robot = operator_arm("ssrms").robot.with_limits(**limits)
    session, log, q = Teleoperation(robot, ["M1"], acceleration=0.1, backend="vm"), SessionLog(), ELBOWED
    session.reset(q)
    for k in range(100):
        log.add(0.02 * k, q, session.step(q, Order((0.05, 0.0, 0.02))))
        q = q + session.control.dt * log.v[-1]
    assert log.seen[0].ramping
    assert log.seen[0].why[0] == "rates rise or fall to what is asked"
    assert log.seen[0].why[1].startswith("acceleration limits of joint")
    if kind == "acceleration":
        assert log.lost_in(1e-3) == []
        assert log.lost[-1] < 1e-3
    else:
        worst = log.seen[log.lost_in(0.1)[0]]
        assert any(text.startswith(f"{kind} limits of joint") for text in worst.why)
        assert not worst.ramping
        assert log.seen[-1].lost > 0.1


def test_the_nearest_locus_is_named(station: Teleoperation) -> None:
    assert station.nearest_locus(BESIDE, "xi | joint2") == "0.012 rad from joint2 = 1.571, where the pair loses rank"


def test_over_determined_motion_has_its_cue(station: Teleoperation) -> None:
    station.control.switch("elbow | xi", 0.0)
    station.reset(ELBOWED)
    q = ELBOWED
    for _ in range(20):
        seen = station.step(q, Order((0.0, 0.0, 0.005)))
        q = q + station.control.dt * seen.step.v
    assert seen.lost == pytest.approx(0.965, abs=0.01)
    assert seen.why[0].startswith("more rows than joints: 1 of 3 directions can be had along (+0.4")


def test_a_log_has_what_there_was_at_ctrl_c(session: Teleoperation, tmp_path: Path) -> None:
    """The interrupt comes in the middle of a tick; what was seen before it is written, in rows of one length."""
    log = SessionLog()

    class Source:
        def order(self, time: float, *given: Any) -> Order:
            if len(log.time) == 7:
                log.time.append(time)
                raise KeyboardInterrupt
            return Order((0.05,))

    found = run_session(session, Source(), Q, log=log)
    assert found is log
    assert found.interrupted
    assert len(found.time) == len(found.q) == len(found.seen) == 7
    text = found.write(tmp_path / "log.csv", session.robot.dof_names).read_text()
    head, *rows = [line.split(",") for line in text.splitlines()]
    assert len(rows) == 7
    assert {"sigma", "kept", "advised", "lost", "why", "asked 1", "met 1"} <= set(head)
    assert float(rows[3][head.index("asked 1")]) == 0.05
    assert float(rows[3][head.index("sigma")]) == pytest.approx(found.seen[3].sigma, rel=1e-5)


def test_what_was_taught_is_done_again(station: Teleoperation, tmp_path: Path) -> None:
    """Orders at odd times, one that becomes stale, changes of pairs by the operator and by the adviser."""
    names, rng = [name for name in station.names if name.startswith("xi |")], np.random.default_rng(3)

    class Operator:
        def order(self, time: float, *given: Any) -> Order | None:
            if rng.uniform() > 0.03:
                return None
            pair = names[int(rng.integers(len(names)))] if rng.uniform() < 0.3 else None
            return Order(tuple(rng.uniform(-0.04, 0.04, 6)), pair=pair)

    station.control.switch(names[0], 0.0)
    station._automatic = True
    try:
        taught = run_session(station, Operator(), BESIDE, seconds=12.0)
    finally:
        station._automatic = False
    assert len(set(taught.active)) > 2
    station.control.switch(names[0], 0.0)
    again = run_session(station, RateFile(taught.save_orders(tmp_path / "taught.csv")), BESIDE)
    assert again.active == taught.active
    np.testing.assert_array_equal(again.q, taught.q)
    with pytest.raises(RangeError, match="no ticks"):
        SessionLog().save_orders(tmp_path / "nothing.csv")


def test_an_error_leaves_the_log(session: Teleoperation) -> None:
    log = SessionLog()

    class Source:
        def order(self, *given: Any) -> Order:
            return Order((0.05,)) if len(log.time) < 5 else Order(pair="none of these")

    with pytest.raises(UnknownNameError):
        run_session(session, Source(), Q, log=log)
    assert len(log.seen) == 5


def test_an_arm_that_is_driven_straight_comes_to_rest() -> None:
    """One arm of a Baxter to the end of its reach with psi held: no lurch, psi stays, and what is lost is told."""
    session = Teleoperation("baxter", ["M6"], backend="vm")
    q = session.start()
    session.reset(q)
    psi = next(one for one in session.control.pair.constraint if str(one) == "left_psi")
    held, lost = expressions.here(session.robot, psi, q), []
    for _ in range(240):
        seen = session.step(q, Order((0.0, 0.02)))
        assert seen.step.ended == "solved"
        assert np.linalg.norm(seen.met[:3]) < 0.021
        lost.append(seen.lost)
        q = pin.integrate(session.robot.model, q, session.control.dt * seen.step.v)
    assert lost[50] < 1e-3
    assert lost[-1] > 0.5
    assert any("sigma" in text for text in seen.why)
    assert np.abs(seen.step.v).max() < 0.1
    assert expressions.here(session.robot, psi, q) == pytest.approx(held, abs=1e-3)


@pytest.mark.parametrize("scaled", [False, True])
def test_a_scaled_session_keeps_the_direction_of_orders_that_are_too_fast(scaled: bool) -> None:
    """Joints of 0.03 rad/s, an order of the six fastest rates: by least squares the tip leaves its direction."""
    robot = load("panda").with_limits(velocity=0.03)
    session = Teleoperation(robot, ["M1"], acceleration=10.0, scaled=scaled, backend="vm")
    q, turned = session.start(), 0.0
    session.reset(q)
    for k in range(25):
        seen = session.step(q, Order((0.3, 0.3, -0.3, 0.07, 0.07, 0.07)))
        q = pin.integrate(session.robot.model, q, seen.step.v * session.control.dt)
        size = float(np.linalg.norm(seen.asked) * np.linalg.norm(seen.met))
        if k > 5 and size > 0.0:
            turned = max(turned, float(np.arccos(np.clip(seen.asked @ seen.met / size, -1.0, 1.0))))
    assert 0.0 < seen.lost < 1.0
    assert turned < 1e-2 if scaled else turned > 0.3
