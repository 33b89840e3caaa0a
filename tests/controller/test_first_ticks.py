"""No tick imports anything or makes a solver, however it ends: that takes longer than a tick may. Compiling does it."""

from __future__ import annotations

import json
import subprocess
import sys

from tests.repeats import ALL, MORE

PROGRAM = """
import json, sys
import numpy as np
from wbc.controller import core_of
import wbc
from tests.stack import small
from wbc.controller.policy import CHAIN
from wbc.tick.buffers import UNSOUND
from wbc.qp.solvers.backend import Backend

made = [0]
real_init = Backend.__init__
def init(self, *arguments):
    made[0] += 1
    real_init(self, *arguments)
Backend.__init__ = init

q = np.array(small.Q)

def compiled(kind, backend):
    stack = wbc.Stack(small.arm(), small.DT)
    stack.add(wbc.tasks.EndEffector("tip", kind="position"), name="hand", scaled=kind == "soft")
    stack.add(wbc.tasks.Posture(), name="posture", weight=1e-3)
    stack.add(wbc.tasks.JointLimits(), name="limits")
    stack.add(wbc.tasks.Hold("tip", kind="position"), name="grip")
    if kind == "soft":
        stack.add(wbc.tasks.FrameVelocityLimit("tip", linear=0.2), name="speed", soft=1.0)
    if kind == "levels":
        stack.add(wbc.tasks.EndEffector("tip", kind="orientation"), name="turn", level=1)
    return stack.compile(backend=backend)

def ticks(controller):
    rows = {}

    def tick(name, one=controller, unsound=False):
        known, made[0] = set(sys.modules), 0
        call = core_of(one).call
        if unsound:
            core_of(one).call = lambda: call() | UNSOUND
        step = one.step(q)
        core_of(one).call = call
        rows[name] = [str(step.status), step.answered_by, sorted(set(sys.modules) - known), made[0]]

    controller["grip"].enabled = False
    for policy in (wbc.Policy(), wbc.Policy(chain=("osqp",))):
        # a clone is as ready as its original, and another policy is prepared when it is set
        other = controller.clone()
        other.policy = policy
        tick(f"clone {policy.chain}", other, unsound=True)
    tick("solved")
    controller["hand"].target = (0.2, 0.6, 0.0)
    tick("solved at work")
    for link in CHAIN:
        controller.policy = wbc.Policy(chain=(link,))
        tick(link, unsound=True)
    controller.policy = wbc.Policy(chain=())
    tick("braking", unsound=True)
    controller.policy = wbc.Policy()
    controller["grip"].enabled, controller["grip"].target = True, (3, 0, 0, 0, 0, 0, 1)
    tick("relaxed")
    for link in CHAIN:
        controller.policy = wbc.Policy(chain=(link,))
        tick(f"relaxed {link}", unsound=True)
    controller.policy = wbc.Policy(conflict="brake")
    tick("policy")
    if controller.backend == "native":
        controller.policy = wbc.Policy()
        controller.iteration_cap = 1
        tick("capped")
    return rows

print(json.dumps([(kind, ticks(compiled(kind, backend))) for kind, backend in json.loads(sys.argv[1])]))
"""


#: What Python does around a tick is the same for both back ends, but that a native one can be capped
KINDS = [("plain", "native"), ("soft", "vm"), ("levels", "vm")]
KINDS += [("plain", "vm"), ("soft", "native"), ("levels", "native")] if MORE >= ALL else []


def test_no_tick_imports_or_makes_a_solver() -> None:
    command = [sys.executable, "-c", PROGRAM, json.dumps(KINDS)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    links = ("cold", "daqp", "osqp", "elastic")
    for kind, rows in found:
        ends = {name: tuple(row[:2]) for name, row in rows.items()}
        assert {link: ends[link] for link in links} == {link: ("recovered", link) for link in links}
        assert ends["solved"] == ("solved", "")
        assert ends["braking"] == ("braked", "braking")
        assert ends["relaxed"] == ("relaxed", "")
        assert ends["policy"] == ("braked", "policy")
        assert {name: row[2] for name, row in rows.items() if row[2]} == {}
        # Below the first level a QP is as large as the space that is left, which only the tick knows: 0.1 ms a solver
        assert max(row[3] for row in rows.values()) <= (1 if kind == "levels" else 0)
