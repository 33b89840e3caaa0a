"""The Space Station arm through joint 2 at 90 degrees, where two usual constraints fail and a set of pairs does not.

The tip is commanded by rates. With the yaw joint locked, or the pitch plane held, the rows lose rank there: joints run
at their limits and the tip does not go where it is told. Inside the set {alpha, beta} the adviser changes the pair on
the way, with joint rates that stay within the acceleration limits.
"""

import numpy as np

from wbc.coordinates import Adviser, AutomaticPairs, CoordinatePair, DriveLog, PairController, parts, plot_drives

PARTS = parts("ssrms")
ARM, ROBOT = PARTS.arms[0], PARTS.robot.with_limits(acceleration=0.02)
HELD = {str(one): one for one in ARM.candidates()}
START = np.array([0.3, 1.3, -0.5, 1.2, 0.7, -0.6, 0.9])
SLOW = np.array([0.0, 0.02, 0.004, -0.008, 0.004, 0.006, -0.004])
DT, TICKS, RAMP = 0.02, 1300, 100


def twist(tick: int) -> np.ndarray:
    """What the operator commands: the tip's motion along a line in the space of joints."""
    return min(1.0, tick / RAMP) * ROBOT.jacobian(START + SLOW * tick * DT, "tip") @ SLOW


def drive(*names: str) -> DriveLog:
    """The same commands with these constraints to choose from."""
    pairs = [CoordinatePair(ARM.tip, HELD[name], name) for name in names]
    adviser, control = Adviser(ROBOT, pairs, exact=False), PairController(ROBOT, pairs, DT)
    auto, log, q = AutomaticPairs(control, adviser, seconds=2.0), DriveLog(names), START
    control.reset(q)
    for tick in range(TICKS):
        command = twist(tick)
        auto.command(command)
        v = auto.step(q).v
        miss = np.linalg.norm((control.rates(q)[ARM.tip] @ v - command)[:3])
        log.add(tick * DT, q, v, adviser.sigmas(q), float(miss), control.active)
        q = q + DT * v
    change = np.abs(np.diff(log.v, axis=0)).max() / DT
    print(
        f"{', '.join(names)}: tip loses at most {max(log.miss):.2e} m/s, joint 2 from {START[1]} to {q[1]:.3f} rad,",
        end=" ",
    )
    print(f"acceleration at most {change:.3f} rad/s^2, pair at the end {control.active}")
    return log


if __name__ == "__main__":
    drives = {"yaw locked": drive("joint2"), "pitch plane held": drive("alpha"), "of a set": drive("alpha", "beta")}
    print(plot_drives("runs/space_arm.png", drives, joint=1, limits=[np.pi / 2]))
