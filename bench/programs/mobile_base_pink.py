"""TIAGo on its two driven wheels follows an eight with its hand, with pink."""

import sys

import numpy as np
import pink
import pinocchio as pin

DT, GAIN, TICKS, RADIUS = 0.04, 10.0, 750, 0.0985
TIP, WHEELS = "arm_tool_link", ("wheel_left_joint", "wheel_right_joint")
whole = pin.buildModelFromUrdf(sys.argv[1], pin.JointModelPlanar())
still = [j for j in range(1, whole.njoints) if "caster" in whole.names[j] or "suspension" in whole.names[j]]
model = pin.buildReducedModel(whole, still, pin.neutral(whole))
model.addFrame(pin.Frame("floor", 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
angles = np.zeros(model.nv)
for name, value in zip(sys.argv[2::2], sys.argv[3::2], strict=True):
    angles[model.idx_vs[model.getJointId(name)]] = float(value)
configuration = pink.Configuration(model, model.createData(), pin.integrate(model, pin.neutral(model), angles))
dofs = [model.idx_vs[model.getJointId(name)] for name in WHEELS]
arm = np.zeros((model.nv - 5, model.nv))
for row, dof in enumerate(k for k in range(3, model.nv) if k not in dofs):
    arm[row, dof] = 1.0
tip = pink.tasks.FrameTask(TIP, position_cost=1.0, orientation_cost=0.0, gain=GAIN * DT)
posture = pink.tasks.LinearHolonomicTask(arm, np.zeros(len(arm)), configuration.q.copy(), cost=3e-3, gain=DT)


class Rolling(pink.tasks.Task):
    """Without slip: forwards and turning as the wheels do, and nowhere sideways."""

    def __init__(self, half_track: float) -> None:
        super().__init__(cost=1.0)
        left, right = dofs
        self.jacobian = np.zeros((3, model.nv))
        self.jacobian[0, [0, left, right]] = 1.0, -RADIUS / 2, -RADIUS / 2
        self.jacobian[1, [2, left, right]] = 1.0, RADIUS / 2 / half_track, -RADIUS / 2 / half_track
        self.jacobian[2, 1] = 1.0

    def compute_error(self, configuration: pink.Configuration) -> np.ndarray:
        return np.zeros(3)

    def compute_jacobian(self, configuration: pink.Configuration) -> np.ndarray:
        return self.jacobian

    def __repr__(self) -> str:
        return "Rolling()"


def goal(k: float) -> np.ndarray:
    """An eight 3 m wide and 1.2 m deep that rises and falls by 0.15 m, at rest at both ends."""
    phase = 2 * np.pi * (k / TICKS - np.sin(2 * np.pi * k / TICKS) / (2 * np.pi))
    return start.translation + [0.6 * np.sin(2 * phase), 1.5 * np.sin(phase), 0.15 * np.sin(3 * phase)]


start, late, slip = configuration.get_transform_frame_to_world(TIP), 0.0, 0.0
track = configuration.get_transform("wheel_left_link", "wheel_right_link").translation
rolling = Rolling(np.linalg.norm(track) / 2)
limits = [pink.limits.ConfigurationLimit(model)]
for k in range(TICKS):
    late = max(late, np.linalg.norm(configuration.get_transform_frame_to_world(TIP).translation - goal(k)))
    # pink has no velocity of a target: it is aimed at ahead by 1 / gain
    tip.set_target(pin.SE3(start.rotation, goal(k + 1 / (GAIN * DT))))
    v = pink.solve_ik(configuration, [tip, posture], DT, solver="daqp", constraints=[rolling], limits=limits)
    slip = max(slip, abs(RADIUS * v[dofs].mean() - v[0]))
    configuration.integrate_inplace(v, DT)

print(f"hand at most {1e3 * late:.2f} mm off an eight of 3 m by 1.2 m; slip at most {1e3 * slip:.4f} mm/s")
if late > 0.05 or slip > 1e-6:
    raise SystemExit("the hand left its path, or a wheel slipped")
