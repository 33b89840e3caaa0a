"""What the robots' files say, read with nothing but the standard library."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from wbc.robot.sources.files import example_data_folder

DATA = Path(__file__).parent / "data"


def joints(path: str | Path) -> dict[str, ElementTree.Element]:
    """Joint elements of a URDF file by name."""
    return {str(j.get("name")): j for j in ElementTree.parse(path).getroot().findall("joint")}


def example(relative: str) -> Path:
    """A file of the example-robot-data wheel."""
    return example_data_folder() / relative
