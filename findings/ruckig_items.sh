#!/bin/sh
# Ruckig 0.19.4 (Python): an element that is assigned to a field of InputParameter is lost without a word.
# Every read of a vector field makes a new list, so inp.max_velocity[0] = 5.0 and inp.enabled[1] = False change a copy,
# and only inp.max_velocity = [...] changes the problem. A controller that writes what its encoders say into
# inp.current_position[k] in a loop plans from where it was set up to be; the calculation succeeds, and begins there.
#
# Fails as soon as an element that is assigned stays.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/env"
"$folder/env/bin/pip" install --quiet "ruckig==0.19.4"
"$folder/env/bin/python" - <<'PYTHON'
from ruckig import InputParameter, Result, Ruckig, Trajectory

FIELDS = {
    "current_position": 0.0,
    "current_velocity": 0.0,
    "target_position": 1.0,
    "max_velocity": 1.0,
    "max_acceleration": 2.0,
    "max_jerk": 4.0,
}

inp = InputParameter(2)
for name, value in FIELDS.items():
    setattr(inp, name, [value, value])
print(f"{'field':<18} {'assigned':>8} {'read again':>10}")
for name, value in FIELDS.items():
    getattr(inp, name)[0] = value + 0.5
    print(f"{name:<18} {value + 0.5:>8} {getattr(inp, name)[0]:>10}")
    assert getattr(inp, name)[0] == value, name
inp.enabled[1] = False
print(f"{'enabled':<18} {'False':>8} {inp.enabled[1]!s:>10}")
assert inp.enabled[1]

planned = Trajectory(2)
assert Ruckig(2).calculate(inp, planned) == Result.Working
begins = planned.at_time(0.0)[0]
print(f"the law of motion begins at {begins}, where 0.5 had been assigned to the first joint")
assert begins == [0.0, 0.0]

inp.current_position = [0.5, 0.0]
assert Ruckig(2).calculate(inp, planned) == Result.Working
assert planned.at_time(0.0)[0] == [0.5, 0.0]
print("a whole list that is assigned stays")
PYTHON
