"""Exports compile as strict C99 without a warning, give Python's commands, and never touch the heap in a step."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import wbc
from tests.export.cases import CASES, STRICT, TRAP, WRAP, build, exported, run
from tests.repeats import ALL, MORE
from tests.stack import small
from wbc.tasks import EndEffector, JointLimits, Posture

#: The UR5 is exported in test_command.py, and built for aarch64 in machines.py where there is qemu
BUILT = [name for name in CASES if name != "ur5"]


@pytest.mark.parametrize("name", BUILT)
def test_a_thousand_states_agree(name: str, root: Path) -> None:
    folder = exported(name, root)
    done = run("make", "run", f"CFLAGS={' '.join(STRICT)}", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    found = re.search(r"(\d+) states: (\d+) solved.* 0 differ, by ([-+.e0-9]+) at most", done.stdout)
    assert found is not None, done.stdout
    assert int(found[1]) == 1000
    assert int(found[2]) > 500
    assert float(found[3]) <= 1e-9


def test_the_check_finds_a_difference(root: Path) -> None:
    folder = exported("panda", root)
    run("make", "check", folder=folder)
    data = bytearray((folder / "check.bin").read_bytes())
    data[-2] ^= 0x10
    (folder / "other.bin").write_bytes(data)
    done = run("./check", "other.bin", folder=folder)
    assert done.returncode == 1
    assert "1 differ" in done.stdout
    (folder / "short.bin").write_bytes(data[:-100])
    assert run("./check", "short.bin", folder=folder).returncode == 2
    assert run("./check", "none.bin", folder=folder).returncode == 2


@pytest.mark.parametrize("name", BUILT)
def test_no_step_uses_the_heap(name: str, root: Path) -> None:
    folder = exported(name, root)

    def trapped(*options: str) -> tuple[int, str]:
        objects = [("trap.o", str(TRAP), *options), ("trapped.o", "check.c", "-Dwbc_step=trapped_step")]
        for output, *rest in objects:
            done = run("gcc", *STRICT, "-I.", "-c", *rest, "-o", output, folder=folder)
            assert done.returncode == 0, done.stderr
        parts = ("trap.o", "trapped.o", "libwbc_tick.a", "daqp/libdaqp.a", "-lm")
        done = run("gcc", WRAP, *parts, "-o", "trapped", folder=folder)
        assert done.returncode == 0, done.stderr
        done = run("./trapped", "check.bin", folder=folder)
        return done.returncode, done.stdout + done.stderr

    code, said = trapped()
    assert code == 0, said
    assert said.startswith("1000 states")
    code, said = trapped("-DLEAK")
    assert (code, said) == (9, "the heap was used within a step\n")


@pytest.mark.parametrize("name", BUILT)
def test_there_is_no_global_state_and_no_name_but_ours(name: str, root: Path) -> None:
    folder = exported(name, root)
    listed = run("nm", "libwbc_tick.a", folder=folder).stdout
    kinds = re.findall(r"^[0-9a-f]+ (\w) (\S+)$", listed, re.MULTILINE)
    assert len(kinds) > 20
    assert not [symbol for kind, symbol in kinds if kind in "bBdDcC"]
    assert all(symbol.startswith("wbc_") for kind, symbol in kinds if kind.isupper())
    solver = run("nm", "daqp/libdaqp.a", folder=folder).stdout
    assert not re.findall(r"^[0-9a-f]+ [bBdDcC] (\S+)$", solver, re.MULTILINE)


#: Warnings of unset variables need some optimisation; more of it takes twice as long
QUICK = "-O2" if MORE >= ALL else "-O1"


def made(kind: str) -> wbc.Stack:
    stack = wbc.Stack(small.arm(), dt=0.01, calm=kind != "linear")
    if kind == "only rows":
        stack.add(wbc.tasks.FrameVelocityLimit("tip", linear=0.5), name="speed")
    elif kind == "only bounds":
        stack.add(JointLimits(), name="limits")
    else:
        stack.add(EndEffector("tip", kind="position"), name="hand")
        stack.add(Posture(), name="posture")
    return stack


@pytest.mark.parametrize(
    ("kind", "flags"),
    [
        ("only rows", QUICK),
        ("only bounds", QUICK),
        ("linear", QUICK),
        ("curved", "-O2"),
    ],
)
def test_parts_that_are_missing_leave_no_warning(kind: str, flags: str, tmp_path: Path) -> None:
    c = made(kind).compile(backend="vm")
    c.reset(small.Q)
    folder = c.export(tmp_path / "out", states=20)
    build(folder, f"TICK_FLAGS={flags}")
    done = run("make", "run", f"CFLAGS={' '.join(STRICT)}", folder=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    assert " 0 differ" in done.stdout
