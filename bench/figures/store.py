"""Files of figures: what was measured, and by which commit, when and on which machine."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from bench.harness import processor
from bench.pool import ROOT
from bench.sheet import Sheet

FOLDER = ROOT / "bench" / "data"
Data = dict[str, Any]


def stamp() -> dict[str, str]:
    """Command, commit, date, machine and its load, to be asked for before anything is measured."""
    load, cores = Path("/proc/loadavg").read_text().split()[0], len(os.sched_getaffinity(0))
    machine = f"{processor()}, {cores} cores, load {load}"
    command = " ".join(["python", *sys.orig_argv[1:]]).replace(f"{ROOT}/", "")
    commit, date = git("rev-parse", "--short", "HEAD"), f"{datetime.now(UTC):%Y-%m-%d}"
    return {"command": command, "commit": commit, "date": date, "machine": machine}


def write(path: Path, about: Mapping[str, str], parts: Mapping[str, Sheet | str]) -> None:
    """The file of a figure: its stamp, and parts that are tables or text."""
    found = {
        name: part if isinstance(part, str) else {"columns": part.columns, "rows": part.rows}
        for name, part in parts.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({"stamp": dict(about), "parts": found}, indent=1, ensure_ascii=False) + "\n")


def read(path: Path) -> Data:
    """A file of figures."""
    data: Data = json.loads(path.read_text())
    return data


def shown(part: str | Data) -> str:
    """A part as Markdown."""
    if isinstance(part, str):
        return part
    return Sheet("", part["columns"], part["rows"]).markdown().split("\n\n", 1)[1]


def signed(about: Mapping[str, str], command: str) -> str:
    """The line under a block; the command is the usual one where the stamp has none."""
    machine = about["machine"].removesuffix(" before the run")
    return f"*`{about.get('command', command)}`, {about['date']}, commit {about['commit']}; {machine}.*"


def changed(commit: str, paths: Sequence[str]) -> list[str] | None:
    """Files under some paths that differ from a commit, or are new since; None: this clone does not have it."""
    try:
        git("cat-file", "-e", f"{commit}^{{commit}}")
    except subprocess.CalledProcessError:
        return None
    new = git("ls-files", "--others", "--exclude-standard", "--", *paths).split()
    return [*git("diff", "--name-only", commit, "--", *paths).split(), *new]


def git(*arguments: str) -> str:
    """What git says about the repository."""
    done = subprocess.run(["git", "-C", str(ROOT), *arguments], capture_output=True, text=True, check=True)
    return done.stdout.strip()
