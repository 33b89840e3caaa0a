#!/usr/bin/env bash
# CasADi 3.8.2, Linux wheel: who opens its library by its usual name, libcasadi.so, gets a second copy of it.
# In the wheel libcasadi.so is a file of its own and not a link to libcasadi.so.3.7, which the Python module needs. The
# dynamic linker knows libraries by name and inode, so ctypes.CDLL("libcasadi.so") after `import casadi` maps all of it
# again: some megabytes more in memory, and other static variables than those that the module's objects were made with.
# RTLD_NOLOAD finds the one that is loaded, by its own name.
#
# Runs public packages alone, in a folder of its own; exits with 1 where the behaviour is another one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check casadi==3.8.2 numpy==2.4.6
"$folder/venv/bin/python" - <<'PYTHON'
import ctypes
import os
import pathlib
import sys

import casadi

folder = pathlib.Path(casadi.__file__).parent
plain, versioned = folder / "libcasadi.so", next(folder.glob("libcasadi.so.[0-9]*"))


def mapped():
    lines = pathlib.Path("/proc/self/maps").read_text().splitlines()
    return sorted({line.split("/")[-1] for line in lines if "/libcasadi.so" in line})


def loaded(path):
    try:
        ctypes.CDLL(str(path), mode=os.RTLD_NOLOAD)
    except OSError:
        return False
    return True


before, found = mapped(), {path.name: loaded(path) for path in (plain, versioned)}
ctypes.CDLL(str(plain))
after = mapped()
print(f"casadi {casadi.__version__}: {plain.name} is a link: {plain.is_symlink()}; loaded by import: {found}")
print(f"mapped after import: {before}; after CDLL({plain.name!r}): {after}")
seen = not plain.is_symlink() and before == [versioned.name] and after == sorted([plain.name, versioned.name])
print("as described" if seen else "another behaviour")
sys.exit(not seen)
PYTHON
