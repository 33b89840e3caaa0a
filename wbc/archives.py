"""Archives of arrays (npz)."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np


@contextmanager
def open_npz(file: str | os.PathLike[str]) -> Iterator[Any]:
    """The arrays of a file by name, none of which is a pickle, while it is open.

    NumPy takes what is no archive for a pickle, and advises to load it unsafely; here it is no zip file.

    Raises:
        OSError: no such file. zipfile.BadZipFile: no archive. ValueError: an array that only a pickle holds is asked
            for.
    """
    with zipfile.ZipFile(file), np.load(file, allow_pickle=False) as data:
        yield data
