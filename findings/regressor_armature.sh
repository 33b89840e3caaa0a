#!/bin/sh
# Pinocchio 4.1.0: rnea counts the armature of motors, the regressor of the same torques does not.
# computeJointTorqueRegressor(model, data, q, v, a) times the links' inertial parameters should be rnea(model, data, q, v, a).
# With model.armature set (rotors of URDF transmissions, <dynamics> of MJCF) rnea, crba and computeKineticEnergy have its
# share, and both regressors (torques and kinetic energy) are without: off by armature times acceleration and by
# armature times speed squared, half of it. Whoever identifies inertias from torques of rnea finds links that are too heavy.
#
# Fails as soon as the regressors have that share, or the difference is another.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "pin==4.1.0" "numpy==2.3.5"
"$folder/env/bin/python" - <<'PYTHON'
import numpy as np
import pinocchio as pin

model = pin.buildSampleModelManipulator()
data = model.createData()
random = np.random.default_rng(0)
q, v, a = random.uniform(-1.0, 1.0, (3, model.nv))
parameters = np.concatenate([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]])
for armature in (0.0, 0.5):
    model.armature = np.full(model.nv, armature)
    torques = pin.rnea(model, data, q, v, a) - pin.computeJointTorqueRegressor(model, data, q, v, a) @ parameters
    energy = pin.computeKineticEnergy(model, data, q, v)
    energy -= pin.computeKineticEnergyRegressor(model, data, q, v) @ parameters
    print(f"armature {armature} kg m^2: torques {abs(torques).max():.6f} N m apart, energies {energy:.6f} J apart")
    assert np.allclose(torques, armature * a, atol=1e-9) and np.isclose(energy, 0.5 * armature * v @ v, atol=1e-9)
PYTHON
