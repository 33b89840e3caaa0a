"""An environment that has everything of this one but Pinocchio, Coal, toppra and ruckig, made of links.

    python -m tests.without build/without      # then build/without/bin/python -m pytest ...

Exit status: 0. Packages that only those need are left out with them; data of robots stay.
"""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from importlib import metadata
from pathlib import Path

#: What begins like these is what pyproject.toml takes on some platforms only, with the libraries below
LEFT_OUT = ("cmeel", "coal", "eigenpy", "libcoal", "libpinocchio", "pin-", "ruckig", "toppra")
#: Folder that several packages share, of which only data are kept
SHARED = "cmeel.prefix"


def make(folder: Path) -> Path:
    """The interpreter of the environment."""
    if folder.exists():
        subprocess.run(["rm", "-r", str(folder)], check=True)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    here = Path(sysconfig.get_path("purelib"))
    there = folder / here.relative_to(sys.prefix)
    for entry in here.iterdir():
        if not entry.name.startswith(LEFT_OUT):
            (there / entry.name).symlink_to(entry)
    (there / SHARED).mkdir()
    (there / SHARED / "share").symlink_to(here / SHARED / "share")
    return folder / "bin" / "python"


def installed(python: Path) -> list[str]:
    """Those of the packages that can still be imported."""
    names = ("pinocchio", "coal", "toppra", "ruckig")
    code = f"import importlib.util as u; print(*(n for n in {names} if u.find_spec(n)))"
    return subprocess.run([str(python), "-c", code], capture_output=True, text=True, check=True).stdout.split()


if __name__ == "__main__":
    made = make(Path(sys.argv[1]).absolute())
    if left := installed(made):
        sys.exit(f"still there: {', '.join(left)}")
    print(made, "without", ", ".join(name.rstrip("-") for name in LEFT_OUT), "of", len(list(metadata.distributions())))
