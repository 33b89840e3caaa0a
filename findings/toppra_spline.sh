#!/bin/sh
# TOPP-RA 0.6.10 (Python): trajectories of its default parametrizer pass the limits they were made for, by several percent.
# compute_trajectory gives a ParametrizeSpline: a cubic through times and positions of the grid, whose accelerations are
# those of the spline and not of the solution. Eight random paths of seven joints through five points pass their limit of
# acceleration by 3 to 10 percent at some instant; parametrizer="ParametrizeConstAccel" of the same solution keeps it to
# 0.1 percent. A robot whose drives check their limits stops on the default ones.
#
# Fails as soon as the default keeps limits to one percent.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "toppra==0.6.10" "numpy==2.3.5"
"$folder/env/bin/python" -W ignore - <<'PYTHON'
import numpy as np
import toppra
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraint

toppra.setup_logging("ERROR")


def excess(seed, **options):
    """Largest acceleration over its limit, of one path through five random points of seven joints."""
    points = np.random.default_rng(seed).uniform(-2.0, 2.0, (5, 7))
    path = toppra.SplineInterpolator(np.linspace(0.0, 1.0, 5), points)
    limits = [JointVelocityConstraint(np.ones(7)), JointAccelerationConstraint(np.full(7, 3.0))]
    trajectory = TOPPRA(limits, path, **options).compute_trajectory()
    return float(np.abs(trajectory(np.linspace(0.0, trajectory.duration, 20001), 2)).max() / 3.0)


default = [excess(seed) for seed in range(8)]
constant = [excess(seed, parametrizer="ParametrizeConstAccel") for seed in range(8)]
print(f"default: {min(default):.3f} to {max(default):.3f} of the limit")
print(f"ParametrizeConstAccel: {min(constant):.3f} to {max(constant):.3f} of the limit")
assert min(default) > 1.01 and max(constant) < 1.002
PYTHON
