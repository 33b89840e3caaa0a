"""``python -m bench.programs``: lengths of the ten programs side by side; ``--peers-python PYTHON`` runs both."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from bench.programs import lengths, results

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--peers-python", default="", help="Python with pink and mink, such as .venv-peers/bin/python.")
given = parser.parse_args().peers_python
sheet = results(given, Path("build/programs")) if given else lengths()
Console(width=None if given else 100).print(sheet.rich())
