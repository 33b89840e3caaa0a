"""Prints for which platforms and Pythons everything that ``pip install wbc`` needs is to be had as wheels.

pip looks through all releases of all packages for each of them, 4 to 8 s of the processor: ``--ends`` asks for the
oldest and the newest Python.

Exit status: 0 where that is so for all of them, 1 where not, 3 where the package index could not be asked.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from packaging.requirements import Requirement

PYTHONS = ("3.11", "3.12", "3.13", "3.14")
#: Name -> what markers ask there
PLATFORMS = {
    "Linux x86-64": ("linux", "x86_64"),
    "Linux aarch64": ("linux", "aarch64"),
    "macOS arm64": ("darwin", "arm64"),
    "Windows x86-64": ("win32", "AMD64"),
}
#: What pip says first where there is no wheel
NONE = "ERROR: No matching"


def tags(system: str, machine: str) -> list[str]:
    """Of wheels that run there: glibc 2.34, macOS 15."""
    if system == "linux":
        return [f"manylinux_2_{minor}_{machine}" for minor in range(17, 35)] + [f"manylinux2014_{machine}"]
    if system == "darwin":
        return [f"macosx_{major}_0_{kind}" for major in range(11, 16) for kind in (machine, "universal2")]
    return ["win_amd64"]


def missing(platform: str, python: str) -> str:
    """What pip says of what is not there; empty where all is."""
    system, machine = PLATFORMS[platform]
    place = {"sys_platform": system, "platform_machine": machine, "python_version": python}
    # pip reads markers as of the machine that it runs on, whatever platform it is asked for
    named = [Requirement(line) for line in tomllib.loads(Path("pyproject.toml").read_text())["project"]["dependencies"]]
    wanted = [f"{r.name}{r.specifier}" for r in named if r.marker is None or r.marker.evaluate(place)]
    asked = [f"--platform={tag}" for tag in tags(system, machine)]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "install", "--dry-run", "--quiet", "--ignore-installed"]
        command += ["--only-binary=:all:", f"--target={folder}", f"--python-version={python}", *asked, *wanted]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    said = [line for line in done.stderr.splitlines() if line.startswith(NONE)]
    return "" if done.returncode == 0 else (said or done.stderr.splitlines() or ["pip failed"])[-1]


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ends", action="store_true", help="the oldest and the newest Python alone")
    pythons = PYTHONS[:: len(PYTHONS) - 1] if parser.parse_args().ends else PYTHONS
    cells = [(platform, python) for platform in PLATFORMS for python in pythons]
    with ThreadPoolExecutor(2) as pool:
        found = dict(zip(cells, pool.map(lambda cell: missing(*cell), cells), strict=True))
    if all(found.values()):
        print("no package index: ", found[cells[0]])
        return 3
    for platform in PLATFORMS:
        said = [found[platform, python] for python in pythons]
        words = ["yes" if not reason else "no " if reason.startswith(NONE) else "?  " for reason in said]
        print(f"{platform:16}", *(f"{python} {word}" for python, word in zip(pythons, words, strict=True)), sep="  ")
    for reason in sorted({reason for reason in found.values() if reason}):
        print(reason)
    print(f"{sum(not reason for reason in found.values())} of {len(cells)}")
    if any(reason.startswith(NONE) for reason in found.values()):
        return 1
    return 3 if any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
