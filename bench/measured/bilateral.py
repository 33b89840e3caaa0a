"""Bilateral teleoperation over delay: what is followed and felt, what is refused, random families, and a picture."""

from __future__ import annotations

import dataclasses

import numpy as np

import wbc
from bench.pool import ROOT
from bench.sheet import Sheet
from tests.teleop.bilateral_runs import DT, drawn, reach
from wbc import style
from wbc.errors import RangeError
from wbc.teleop.bilateral import (
    Bilateral,
    BilateralRecord,
    Device,
    Link,
    Operator,
    Scheme,
    Wall,
    four_channel,
    position_force,
    position_position,
    run_bilateral,
)
from wbc.teleop.bilateral.arms import FollowingArm

PICTURE = ROOT / "docs" / "images" / "bilateral.png"
DEVICE, LIGHT = Device(2.0, 15.0), Device(2.0, 10.0)
SCHEMES = {
    "position-position": position_position(), "position-force": position_force(), "four-channel": four_channel(),
}  # fmt: skip
#: Delay there and back [s], jitter [s] and loss of each direction
LINKS = ((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.2, 0.0, 0.0), (0.4, 0.0, 0.0), (0.6, 0.0, 0.0), (0.6, 0.1, 0.3))
WALL = Wall(0.15)
#: Robots: master, slave, how much more the slave moves, whether joint by joint
PAIRS = (
    ("panda", "ssrms", 3.0, False), ("xarm7", "ur10", 1.0, False), ("ur5", "talos_left_arm", 0.5, False),
    ("ur3", "panda", 1.0, False), ("ur3", "ur10", 1.0, True), ("z1", "ur5", 1.0, True),
)  # fmt: skip
TIPS = {
    "panda": "panda_hand_tcp", "ssrms": "tip", "xarm7": "link_eef", "ur10": "tool0", "ur5": "tool0", "ur3": "tool0",
    "talos_left_arm": "gripper_left_base_link",
}  # fmt: skip
#: Joints of the Space Station arm at the start [degrees]
BENT = (0.0, 30.0, -60.0, 90.0, -60.0, 20.0, 0.0)
SECONDS = 8.0
#: Random systems of a batch, batches, and their length in ticks
FAMILY, BATCHES, TICKS = 250, 16, 1200


def parts() -> dict[str, Sheet | str]:
    """What is felt, what is accepted without passivity control, and the random families."""
    _picture()
    return {"felt": _felt(), "accepted": _accepted(), "robots": _robots(), "families": _families()}


def _felt() -> Sheet:
    """Free motion and contact by each scheme and link, with passivity control."""
    cases = [(name, link) for name in SCHEMES for link in LINKS]
    systems = [_system(SCHEMES[name], *link) for name, link in cases]
    path = reach(seconds=SECONDS)
    count = len(cases)
    hands = [Operator(path)] * (2 * count)
    run = run_bilateral(systems * 2, hands, [Wall()] * count + [WALL] * count)
    rows = []
    for k, (name, (delay, jitter, loss)) in enumerate(cases):
        late = round(0.5 * delay / DT)
        behind = run.slave[late:, k, 0] - run.master[: len(run.master) - late, k, 0]
        at, touch = round(3.9 / DT), count + k
        felt = run.operator_force[at, touch, 0] / (run.master[at, touch, 0] - WALL.at)
        damped = (run.scale[:, touch] < 0.999).any(axis=1).mean()
        link = f"{1e3 * delay:.0f}" + (f", jitter {1e3 * jitter:.0f}, loss {loss:.0%}" if jitter else "")
        ratio = -run.operator_force[at, touch, 0] / run.wall_force[at, touch, 0]
        kept = (run.taken - run.given)[-1, touch]
        rows.append((
            name, link, f"{1e3 * np.sqrt(np.mean(behind**2)):.1f}", f"{felt:.0f}", f"{ratio:.2f}",
            f"{1e3 * abs(run.slave[-1, touch, 0]):.0f}", f"{damped:.0%}", f"{kept:.2f}",
        ))  # fmt: skip
    columns = (
        "scheme", "round trip, ms", "following, mm rms", "felt stiffness, N/m", "felt force", "back at rest, mm",
        "ticks damped", "energy kept, J",
    )  # fmt: skip
    return Sheet("", columns, rows)


def _system(scheme: Scheme, delay: float, jitter: float, loss: float) -> Bilateral:
    link = Link(0.5 * delay, jitter, loss)
    return Bilateral(scheme, DEVICE, DEVICE, link, link, DT)


def _robots() -> Sheet:
    """Pairs of robots with four channels, 600 ms, jitter and losses: to a wall and back."""
    system, path = _system(SCHEMES["four-channel"], 0.6, 0.05, 0.1), reach(0.1, SECONDS, 3, 1)
    rows = []
    for lead, follow, scale, by_joints in PAIRS:
        n, wall = (6 if by_joints else 3), Wall(0.05)
        arms = tuple(
            FollowingArm(
                wbc.robots.load(name), None if by_joints else TIPS[name], dt=DT, scale=part,
                q=np.radians(BENT) if name == "ssrms" else None,
            )
            for name, part in ((lead, 1.0), (follow, scale))
        )  # fmt: skip
        run = run_bilateral(system, Operator(reach(0.1, SECONDS, n, 1) if by_joints else path), wall, arms=arms)
        at = round(3.9 / DT)
        space = "joints" if by_joints else "hand"
        off = [arm.move(x[-1, 0]) - x[-1, 0] for arm, x in zip(arms, (run.master, run.slave), strict=True)]
        rows.append((
            f"{lead}, {follow}", space, f"{scale:g}", f"{1e3 * run.slave[at, 0, 1]:.0f}",
            f"{run.operator_force[at, 0, 1]:.1f}", f"{-run.wall_force[at, 0, 1]:.1f}",
            f"{1e3 * abs(run.slave[-1, 0, 1]):.1f}", f"{1e3 * np.abs(off).max():.2g}",
            f"{(run.taken - run.given).min():.2g}",
        ))  # fmt: skip
    columns = (
        "master, slave", "by", "scale", "slave at the wall", "felt, N", "on the wall, N", "at the end",
        "arms off devices", "least energy kept, J",
    )  # fmt: skip
    return Sheet("", columns, rows)


def _accepted() -> Sheet:
    """Round trips up to which a scheme is accepted without passivity control, by damping of both devices."""
    rows = []
    for name, scheme in SCHEMES.items():
        cells = [name]
        for damping in (6.0, 15.0, 40.0, 100.0):
            trips = [2 * n * DT for n in range(81) if _fits(scheme, Device(2.0, damping), n * DT)]
            cells.append(f"{1e3 * max(trips):.0f}" if trips else "none")
        rows.append(tuple(cells))
    return Sheet("", ("scheme", "6 N s/m", "15 N s/m", "40 N s/m", "100 N s/m"), rows)


def _fits(scheme: Scheme, device: Device, delay: float) -> bool:
    try:
        Bilateral(scheme, device, device, Link(delay), Link(delay), DT, passivity=False)
    except RangeError:
        return False
    return True


def _families() -> str:
    """Random systems, each with and without passivity control."""
    wild, worst, most = 0, 0.0, -np.inf
    for batch in range(BATCHES):
        rng = np.random.default_rng(1000 + batch)
        systems, hands, walls = zip(*[drawn(rng, TICKS) for _ in range(FAMILY)], strict=True)
        run = run_bilateral(systems, hands, walls, seed=batch)
        size = run.injected.max(axis=0) + 1e-9
        worst = max(worst, float(((run.given - run.taken) / size).max()))
        most = max(most, float(((run.stored - run.injected) / size)[1:].max()))
        free = [dataclasses.replace(one, passivity=False, unchecked=True) for one in systems]
        with np.errstate(all="ignore"):
            wild += int((~(run_bilateral(free, hands, walls, seed=batch).excess() < size)).sum())
    return (
        f"Of {FAMILY * BATCHES} random systems (gains over four decades, devices at their bounds, up to 600 ms each "
        f"way, jitter up to 300 ms, up to 90 % lost) {wild} had, without passivity control, more than twice the energy "
        f"that their operator put in. With it none had more than was put in (largest excess {max(most, 0.0):.1g} of "
        "it), and at no tick did both sides together give out more than they had taken in (largest excess "
        f"{max(worst, 0.0):.1g})."
    )


def _picture() -> None:
    """Forces that are late, on a wall, without passivity control and with it, and four channels."""
    free = Bilateral(SCHEMES["position-force"], LIGHT, LIGHT, Link(0.3), Link(0.3), DT, passivity=False, unchecked=True)
    systems = [free, dataclasses.replace(free, passivity=True), _system(SCHEMES["four-channel"], 0.6, 0.0, 0.0)]
    run = run_bilateral(systems, [Operator(reach(seconds=SECONDS), k) for k in (100.0, 100.0, 400.0)], [WALL] * 3)
    titles = ("position-force, no control", "position-force, passive", "four-channel, passive")
    with style.pyplot() as plt:
        figure, panels = plt.subplots(3, 3, figsize=(12.0, 7.2), layout="constrained", sharex=True)
        for k, title in enumerate(titles):
            _column(panels[:, k], run, k)
            panels[0, k].set_title(title)
            panels[2, k].set_xlabel("time [s]")
        for panel, label in zip(panels[:, 0], ("position [m]", "force [N]", "energy [J]"), strict=True):
            panel.set_ylabel(label)
            panel.legend(loc="best")
        figure.savefig(PICTURE)
        plt.close(figure)


def _column(panels: np.ndarray, run: BilateralRecord, k: int) -> None:
    time = run.time
    panels[0].set_ylim(-0.2, 0.35)
    panels[1].set_ylim(-45, 65)
    panels[0].axhline(WALL.at, color=style.GREY, lw=0.8, ls=":")
    panels[0].plot(time, run.master[:, k, 0], color=style.BLUE, label="master")
    panels[0].plot(time, run.slave[:, k, 0], color=style.ORANGE, label="slave")
    panels[1].plot(time, run.operator_force[:, k, 0], color=style.BLUE, label="operator")
    panels[1].plot(time, -run.wall_force[:, k, 0], color=style.ORANGE, label="on the wall")
    panels[2].plot(time, run.taken[:, k], color=style.TEAL, label="taken in")
    panels[2].plot(time, run.given[:, k], color=style.RED, label="given out")
