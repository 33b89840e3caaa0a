"""Versions of packages in the environments that are compared."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Sequence

from bench.pool import ROOT


def versions(python: str, own: Sequence[str], peers_python: str | None, peers: Sequence[str]) -> dict[str, str]:
    """Name -> version; of packages that both have, the peers' is beside."""
    out = _versions(python, own)
    if peers_python is not None:
        found = _versions(peers_python, peers)
        out |= {name if name not in out else f"peers' {name}": version for name, version in found.items()}
    return out


def _versions(python: str, names: Sequence[str]) -> dict[str, str]:
    code = "import importlib.metadata as m, json, sys; print(json.dumps({n: m.version(n) for n in sys.argv[1:]}))"
    done = subprocess.run([python, "-c", code, *names], capture_output=True, text=True, check=True, cwd=ROOT.anchor)
    found: dict[str, str] = json.loads(done.stdout)
    return found
