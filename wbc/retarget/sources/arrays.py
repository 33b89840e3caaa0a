"""Arrays of npy and npz files, and of pickles of numpy, scipy, chumpy and torch, from which nothing else is built."""

from __future__ import annotations

import pathlib
import pickle
import zipfile
from collections.abc import Sequence
from typing import IO, Any

import numpy as np

from wbc.archives import open_npz
from wbc.retarget.sources.recorded import no_clip

#: What a pickle of arrays may ask for: names by module, which is called otherwise in other versions
SAFE = {
    "numpy": {"ndarray", "dtype"}, "numpy._core.multiarray": {"_reconstruct", "scalar"}, "_codecs": {"encode"},
    "scipy.sparse": {"csc_matrix", "csr_matrix"}, "builtins": {"set"}, "collections": {"OrderedDict"},
}  # fmt: skip
#: Storages of torch's tensors that are read
STORAGES = {"FloatStorage": np.float32, "DoubleStorage": np.float64}


class _PlainArray:
    """Stands for what is not a plain array in the pickle of a body model, such as chumpy's: keeps its state."""

    def __init__(self, *arguments: Any) -> None:
        self.arguments = arguments

    def __setstate__(self, state: Any) -> None:
        self.state = state

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return np.asarray(self.state["x"], dtype=dtype)


class _ArrayUnpickler(pickle.Unpickler):
    """Builds arrays, sparse matrices, tensors and plain data, and calls nothing else."""

    def __init__(self, stream: IO[bytes], archive: zipfile.ZipFile | None = None, folder: str = "") -> None:
        super().__init__(stream, encoding="latin1")
        self._archive, self._folder = archive, folder

    def find_class(self, module: str, name: str) -> Any:
        if module.split(".")[0] == "chumpy":
            return _PlainArray
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return _rebuilt
        if module == "torch" and name in STORAGES:
            return STORAGES[name]
        home = "scipy.sparse" if module.startswith("scipy.sparse.") else module.replace("numpy.core", "numpy._core")
        if name in SAFE.get(home, ()):
            return super().find_class(home, name)
        raise pickle.UnpicklingError(f"{module}.{name} is no array, nor a tensor of float32 or float64")

    def persistent_load(self, pid: Any) -> Any:
        if self._archive is None:
            raise pickle.UnpicklingError("a tensor outside of torch's files")
        _, kind, key, _, _ = pid
        return np.frombuffer(self._archive.read(f"{self._folder}data/{key}"), kind)


def _rebuilt(storage: Any, offset: int, size: Sequence[int], stride: Sequence[int], *_rest: object) -> Any:
    return storage[offset + sum(step * axis for step, axis in zip(stride, np.indices(size), strict=True))]


def load(path: pathlib.Path) -> Any:
    """The array of an npy or pt, arrays by name of an npz without those that only a pickle holds, or what the pickle of
    any other file holds; :class:`ClipFileError` where it is no such file or asks for anything but arrays.
    """
    kind = path.suffix.lower()
    try:
        if kind == ".npy":
            return np.load(path, allow_pickle=False)
        if kind == ".npz":
            with open_npz(path) as data:
                return {name: values for name in data.files if (values := _plain(data, name)) is not None}
        if kind == ".pt":
            with zipfile.ZipFile(path) as archive:
                folder = next(name for name in archive.namelist() if name.endswith("data.pkl")).removesuffix("data.pkl")
                return _ArrayUnpickler(archive.open(f"{folder}data.pkl"), archive, folder).load()
        with path.open("rb") as stream:
            return _ArrayUnpickler(stream).load()
    except Exception as error:
        # Of files that are cut off, or no files of theirs, numpy, zipfile and pickle raise errors of many kinds
        raise no_clip(path, f"no {kind[1:]} of arrays that can be read, or it is cut off: {error}") from error


def _plain(data: Any, name: str) -> Any:
    try:
        return data[name]
    except ValueError as error:
        if "pickle" not in str(error):
            raise
        return None
