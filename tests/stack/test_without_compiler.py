"""Without a C compiler, or with one that fails: the virtual machine, the same answers, one line in the log."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest

from tests.stack import small

ROOT = pathlib.Path(__file__).parents[2]

#: Compiles three stacks, two of them alike but for a weight; prints what came out, with every log record
SCRIPT = """
import json, logging, sys
records = []
class Keep(logging.Handler):
    def emit(self, record):
        records.append([record.name, record.levelname, record.getMessage()])
logging.getLogger().addHandler(Keep())
import wbc
imported = list(records)
from tests.stack import small
made = [small.stack().compile(), small.stack(gain=3.0).compile(), small.stack(small.arm(length=0.6)).compile()]
small.command(made[1])
try:
    small.stack().compile(backend="native")
    refused = None
except wbc.errors.CompileError as error:
    refused = [error.field, str(error)]
print(json.dumps({
    "imported": imported,
    "records": records,
    "backends": [c.backend for c in made],
    "commands": [small.command(made[0]), small.command(made[2])],
    "refused": refused,
}))
"""


def run(cache: pathlib.Path, **environment: str) -> dict[str, object]:
    """What the script prints in a process of its own."""
    unchosen = {k: v for k, v in os.environ.items() if k != "WBC_CC"}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        cwd=ROOT,
        env={**unchosen, "WBC_CACHE": str(cache), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def native() -> list[list[float]]:
    """The script's commands by native ticks."""
    made = [small.stack().compile(backend="native"), small.stack(small.arm(length=0.6)).compile(backend="native")]
    assert [c.backend for c in made] == ["native", "native"]
    return [small.command(c) for c in made]


def check(found: dict[str, object], native: list[list[float]], *texts: str) -> None:
    """All on the virtual machine, the same answers, and one warning that says these texts."""
    assert found["imported"] == [], "import alone says nothing"
    assert found["backends"] == ["vm"] * 3
    assert np.abs(np.subtract(found["commands"], native)).max() < 1e-9
    assert [record[:2] for record in found["records"]] == [["wbc", "WARNING"]]
    for text in (*texts, "virtual machine"):
        assert text in found["records"][0][2]


def test_no_compiler(tmp_path: pathlib.Path, native: list[list[float]]) -> None:
    found = run(tmp_path, WBC_CC="")
    check(found, native, "no C compiler")
    field, text = found["refused"]
    assert field == "backend"
    assert "no C compiler" in text
    assert "daqp" not in text, "that is there"


def test_compiler_that_does_not_exist(tmp_path: pathlib.Path, native: list[list[float]]) -> None:
    found = run(tmp_path, WBC_CC="gcc-of-nowhere")
    check(found, native, "no C compiler", "gcc-of-nowhere")
    assert "gcc-of-nowhere" in found["refused"][1]


def test_no_compiler_on_the_path(tmp_path: pathlib.Path, native: list[list[float]]) -> None:
    check(run(tmp_path, PATH=str(tmp_path)), native, "neither gcc nor cc")


@pytest.mark.parametrize(
    ("script", "texts"),
    [
        pytest.param(
            '#!/bin/sh\nfor i in 1 2 3 4 5 6; do echo "cc: fatal $i" >&2; done\nexit 1\n',
            ("cc: fatal 1", "cc: fatal 2"),
            id="fails",
        ),
        pytest.param("#!/bin/sh\nexit 3\n", ("exit status 3",), id="fails without a word"),
        pytest.param("#!/nowhere/sh\n", ("cannot be started",), id="cannot be started"),
        pytest.param("#!/bin/sh\nprintf '\\377\\376' >&2\nexit 1\n", ("failed",), id="says no text"),
    ],
)
def test_compiler_that_fails(
    script: str, texts: tuple[str, ...], tmp_path: pathlib.Path, native: list[list[float]]
) -> None:
    compiler = tmp_path / "broken-cc"
    compiler.write_text(script)
    compiler.chmod(0o755)
    found = run(tmp_path / "cache", WBC_CC=str(compiler))
    check(found, native, *texts, str(compiler))
    assert "cc: fatal 5" not in found["records"][0][2], "the first lines only"
    field, text = found["refused"]
    assert field == "compiler"
    for said in texts:
        assert said in text
    left = [p for p in (tmp_path / "cache").iterdir() if p.is_dir()]
    assert len(left) == 2, "two entries for the virtual machine, nothing of the failed builds"


def test_casadi_without_the_solver_library(tmp_path: pathlib.Path) -> None:
    """A compiler alone is not enough."""
    script = (
        "import pathlib, wbc\nfrom wbc.native import toolchain\n"
        "toolchain.library = lambda: pathlib.Path('/nowhere.a')\n"
        "from tests.stack import small\nc = small.stack().compile()\nassert c.backend == 'vm'\n"
        "try:\n    small.stack().compile(backend='native')\n"
        "except wbc.errors.CompileError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env={**os.environ, "WBC_CACHE": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "no static daqp library" in done.stdout
    assert "no C compiler" not in done.stdout
    assert done.stderr.count("virtual machine") == 1
