"""What the header says is what the controller has, and the functions do in C what attributes do in Python."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import wbc
from tests.export.cases import CASES, STRICT, build, exported, panda, run
from tests.repeats import ALL, MORE
from tests.stack import small
from wbc.api import Controller
from wbc.controller import core_of
from wbc.export.memory import bytes_of_tick
from wbc.shapes import Box

API = Path(__file__).with_name("api.c")


def defines(folder: Path) -> dict[str, str]:
    return dict(re.findall(r"^#define (WBC_\w+) (\S+)", (folder / "wbc_tick.h").read_text(), re.MULTILINE))


def test_the_functions_do_what_attributes_do(root: Path) -> None:
    folder, c = exported("panda", root), panda()
    done = run("gcc", *STRICT, "-I.", str(API), "libwbc_tick.a", "daqp/libdaqp.a", "-lm", "-o", "api", folder=folder)
    assert done.returncode == 0, done.stderr
    said = {
        line.split()[0]: [float(x) for x in line.split()[1:]]
        for line in run("./api", folder=folder).stdout.splitlines()
    }
    q = c.stack.robot.neutral
    first = c.step(q)
    assert said["first"][1:] == first.v.tolist()
    assert said["other"] == said["first"]
    c["posture"].weight = 0.25
    place = c["hand"].target
    c["hand"].target = pin.SE3(place.rotation, place.translation + np.array([0.05, 0.0, 0.0]))
    mask = c["ball"].mask
    mask[0] = 0.0
    c["ball"].mask = mask
    mask = c["limits"].mask
    mask[1] = 0.0
    c["limits"].mask = mask
    c.reset()
    v = np.zeros(7)
    v[0] = 0.1
    changed = c.step(q, v, dt=0.004)
    assert said["changed"][0] == 0
    assert np.abs(np.array(said["changed"][1:]) - changed.v).max() < 1e-12
    moved = pin.integrate(c.stack.robot.model, q, 0.5 * changed.v)
    assert np.abs(np.array(said["moved"][1:]) - moved).max() < 1e-12
    assert said["refused"] == [-1, -4, -4, -4, -4]
    assert said["weights"] == [-4, core_of(c).tick.weight[core_of(c).layout.blocks["posture"].start]]


@pytest.mark.parametrize("name", CASES)
def test_places_and_sizes_are_those_of_the_layout(name: str, root: Path) -> None:
    folder, c = exported(name, root), CASES[name]()
    told, layout = defines(folder), core_of(c).layout
    sizes = {"NQ": layout.nq, "NV": layout.nv, "NP": layout.parameters, "TASK_ROWS": layout.task_rows}
    sizes |= {"ROWS": layout.general_rows, "MARGINS": layout.margin_rows, "BOUND_BLOCKS": layout.bound_blocks}
    assert {key: int(told[f"WBC_{key}"]) for key in sizes} == sizes
    for block in layout.blocks.values():
        item = block.entry.name.upper().replace(" ", "_")
        for slot in block.slots.values():
            assert int(told[f"WBC_P_{item}_{slot.input.name.upper()}"]) == slot.start
        kind = {"task": "TASK", "bounds": "BOUND"}.get(block.form, "ROW")
        assert int(told[f"WBC_{kind}_{item}"]) == block.start * (layout.nv if kind == "BOUND" else 1)
    size = int(core_of(c).tick._library.wbc_tick_size())
    assert size <= int(told["WBC_BYTES"]) < size + 4096


def test_the_size_is_refused_where_the_structure_has_grown(root: Path) -> None:
    folder = exported("panda", root)
    tick, stack = ((folder / "tick" / name).read_text() for name in ("tick.h", "stack.h"))
    layout = core_of(CASES["panda"]()).layout
    grown = tick.replace("    int warm;", "    double more[3][1000 * (NV + 1)], other;\n    int warm;").replace(
        "[3][", "[3 * "
    )
    assert bytes_of_tick(grown, stack, layout) - bytes_of_tick(tick, stack, layout) >= 8 * 3 * 1000 * 8
    text = (folder / "wbc_tick.h").read_text()
    (folder / "small.h").write_text(re.sub(r"(#define WBC_BYTES) \d+", r"\1 512", text))
    source = (folder / "wbc_tick.c").read_text().replace('"wbc_tick.h"', '"small.h"')
    (folder / "small.c").write_text(source)
    done = run("gcc", "-std=c99", "-Idaqp/include", "-c", "small.c", "-o", "small.o", folder=folder)
    assert done.returncode != 0
    assert "wbc_memory_is_large_enough" in done.stderr


def test_names_that_would_collide_get_numbers(tmp_path: Path) -> None:
    robot = small.stack().robot
    stack = wbc.Stack(robot, dt=0.005)
    for name in ("rows", "a b", "a-b", "end */ int x;"):
        stack.add(wbc.tasks.Posture(), name=name)
    c = stack.compile(backend="vm")
    c.reset(robot.neutral)
    folder = c.export(tmp_path / "names", states=20)
    text = (folder / "wbc_tick.h").read_text()
    names = re.findall(r"^#define (WBC_\w+)", text, re.MULTILINE)
    assert len(names) == len(set(names))
    assert {"WBC_TASK_A_B", "WBC_TASK_A_B_2", "WBC_TASK_ROWS", "WBC_TASK_ROWS_2"} <= set(names)
    build(folder)
    done = run("make", "run", f"CFLAGS={' '.join(STRICT)}", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr


def boxed(backend: str) -> Controller:
    """A Panda with a box that Coal measures."""
    robot = panda("vm").stack.robot
    stack = wbc.Stack(robot, dt=0.005)
    stack.add(wbc.tasks.EndEffector("panda_hand_tcp"), name="hand")
    stack.add(wbc.tasks.JointLimits(), name="limits")
    place = pin.SE3(np.eye(3), np.array([0.4, 0.0, 0.3]))
    stack.add(wbc.tasks.Obstacle(Box((0.1, 0.2, 0.3)), margin=0.02, pose=place), name="box")
    c = stack.compile(backend=backend)
    c.reset(robot.neutral)
    return c


@pytest.mark.parametrize("backend", ["vm"] if MORE < ALL else ["native", "vm"])
def test_sensed_pairs_are_inputs(backend: str, tmp_path: Path) -> None:
    folder = boxed(backend).export(tmp_path / "box", states=120)
    text = (folder / "wbc_tick.h").read_text()
    assert text.count("SENSED: the caller measures it") == 4
    build(folder)
    done = run("make", "run", f"CFLAGS={' '.join(STRICT)}", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.search(r"^[1-9]\d* states.* 0 differ", done.stdout, re.MULTILINE)


def test_a_capped_export_is_capped(tmp_path: Path) -> None:
    c = panda()
    c.iteration_cap = 1
    folder = c.export(tmp_path / "capped", states=300)
    build(folder)
    done = run("make", "run", f"CFLAGS={' '.join(STRICT)}", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"(\d+) capped; 0 differ", done.stdout)
    assert found is not None
    assert int(found[1]) > 10
