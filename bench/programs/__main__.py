"""``python -m bench.programs PYTHON``: run the ten programs, here and as the peers have them.

PYTHON is an interpreter with pink and mink, such as .venv-peers/bin/python; what each prints follows its name.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from bench.pool import ROOT
from bench.programs import PROGRAMS, arguments

for program in PROGRAMS:
    if not program.display:
        theirs = [sys.argv[1], program.theirs, *arguments(program, Path("build/programs"))]
        for command in ([sys.executable, program.ours], theirs):
            print(f"{Path(command[1]).relative_to(ROOT)}:", flush=True)
            subprocess.run(command, check=False)
