"""All figures of the pages: by which command each is made, what it measures, and how it is shown."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from bench.figures import pages, store
from bench.pool import ROOT

#: What a tick consists of
TICK = ("wbc/controller", "wbc/stack", "wbc/qp", "wbc/symbolic", "tasks")
#: What a walk consists of
WALK = (*TICK, "wbc/climb", "robots")


@dataclass(frozen=True)
class Figure:
    """What one command measures.

    Attributes:
        name: of the file in bench/data, and of the module of bench.measured unless there is a command.
        measures: files and folders of the repository whose change makes it old.
        minutes: that it takes on two quiet cores, about.
        command: with a file of its own, which has the stamp under "stamp".
        views: part -> module and function that show it, imported for a page that has it; none: the parts of
            :func:`bench.figures.store.write`.
    """

    name: str
    measures: tuple[str, ...]
    minutes: float
    command: tuple[str, ...] = ()
    file: str = ""
    views: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def path(self) -> Path:
        """The file."""
        return ROOT / self.file if self.file else store.FOLDER / f"{self.name}.json"

    @property
    def told(self) -> str:
        """The command as a reader would type it."""
        return " ".join(self.command) if self.command else f"python -m bench.figures --only {self.name}"


_ALL = (
    Figure(
        "bench", (*TICK, "wbc/proximity", "wbc/export", "bench/ours.py"), 15.0, ("make", "bench"),
        "bench/results.json", {"readme": "bench.report:readme", "export": "bench.report:export_page"},
    ),
    Figure(
        "ik", (*TICK, "wbc/ik", "bench/ik/chains.py", "bench/ik/contenders.py"), 6.0, ("make", "bench-ik"),
        "bench/ik.json", {"chains": "bench.ik.run:summary"},
    ),
    Figure(
        "walk", (*WALK, "bench/climb/walker.py"), 20.0,
        ("python", "-m", "bench.climb.walker", "--output", "bench/data"),
        "bench/data/walker.json", {"all": "bench.climb.walker:page"},
    ),
    Figure("backends", TICK, 0.5),
    Figure("batch", (*TICK, "wbc/batch"), 1.0),
    Figure("cortex_m7", (*TICK, "wbc/export", "tests/export/single.py", "bench/cortex_m7"), 5.0),
    Figure("changing", (*TICK, "wbc/native"), 3.0),
    Figure(
        "plan", ("wbc/plan", "bench/plan"), 60.0,
        ("python", "-m", "bench.plan", "--peers-python", ".venv-plan/bin/python", "--write", "bench/data/plan.json"),
        "bench/data/plan.json", {"peers": "bench.plan.tables:page"},
    ),
    Figure(
        "plan_constrained", ("wbc/plan", "bench/plan"), 5.0,
        ("python", "-m", "bench.plan", "--constrained", "--seeds", "8", "--write", "bench/data/plan_constrained.json"),
        "bench/data/plan_constrained.json", {"table": "bench.plan.constrained:page"},
    ),
    Figure(
        "retarget", (*TICK, "wbc/retarget", "bench/retarget.py", "bench/retarget_peers.py"), 15.0,
        ("python", "-m", "bench.retarget", "--peers-python", ".venv-peers/bin/python", "--json",
         "bench/data/retarget.json"),
        "bench/data/retarget.json", {"peers": "bench.retarget:page"},
    ),
    Figure(
        "climb_torques", (*WALK, "wbc/simulation", "bench/climb/torques.py"), 90.0,
        ("python", "-m", "bench.climb", "torques", "--seeds", "20", "--write"),
    ),
    Figure("dynamics", ("wbc/published/newton_euler", "wbc/motion_control"), 3.0),
    Figure("motion_control", (*TICK, "wbc/motion_control", "wbc/published/newton_euler"), 3.0),
    Figure("first_command", (*TICK, "wbc/native", "wbc/robot"), 3.0),
    Figure("fsp", ("wbc/resolvers", "wbc/explore", "wbc/published/ikor"), 4.0),
    Figure("programs", ("examples", "bench/programs"), 0.1),
    Figure("learning", (*TICK, "wbc/batch"), 0.5),
    Figure("recorded", (*TICK, "wbc/record", "wbc/formats"), 15.0),
    Figure("relative_motion", ("wbc/published/relative_motion", "wbc/symbolic/taylor.py"), 0.2),
    Figure("resolvers", (*TICK, "wbc/resolvers", "wbc/coordinates"), 1.0),
    Figure("servos", (*TICK, "wbc/servo", "wbc/simulation/mujoco_plant.py", "bench/servo_arm.xml"), 2.0),
    Figure("loops", (*TICK, "wbc/robot/loops.py", "tests/loops/mechanisms.py"), 3.0),
    Figure("solvers", TICK, 1.0),
    Figure("torque_walks", (*WALK, "wbc/simulation"), 3.0),
    Figure("torques", (*TICK, "bench/torque_peer.py"), 1.5),
)  # fmt: skip
FIGURES = {figure.name: figure for figure in _ALL}


def render(name: str, part: str) -> str:
    """A block: the part, and a line that says where it comes from."""
    figure = FIGURES[name]
    data = store.read(figure.path) if figure.path.is_file() else {}
    try:
        text = shown(figure.views[part], data) if figure.views else store.shown(data["parts"][part])
    except KeyError:  # the file, or this part of it, is still to be written
        return f"*Not measured yet: `{figure.told}`.*"
    return f"{text}\n\n{store.signed(data['stamp'], figure.told)}"


def shown(view: str, data: store.Data) -> str:
    """A file as one of :attr:`Figure.views` shows it."""
    module, name = view.split(":")
    return str(getattr(importlib.import_module(module), name)(data))


def write_blocks() -> list[str]:
    """Write every block; names of the pages that changed."""
    out = []
    for page in pages.all_pages():
        text = page.read_text()
        new = pages.rendered(text, render)
        if new != text:
            page.write_text(new)
            out.append(page.relative_to(ROOT).as_posix())
    return out
