"""Checks at the border: every value that a user hands in passes through one of these.

Each function returns a fresh float64 copy (or a float) and raises a typed error that names
the field; nothing is changed when it raises.
"""

from __future__ import annotations

import contextlib
import math
import os
import pathlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from wbc.errors import NotFiniteError, RangeError, RotationError, ShapeError, UnknownNameError, WbcError
from wbc.multibody import is_pose, own, pin

Array = NDArray[np.float64]
T = TypeVar("T")

#: How far a rotation may be from orthonormal (Frobenius norm of R'R - I) or a quaternion from unit length.
ROTATION_TOLERANCE = 1e-6

#: Numbers beyond this have products that overflow in what is computed from them
LARGEST = 1e60
#: Numbers below this have products that vanish in what is computed from them
SMALLEST = 1e-60

#: Arrays of fewer numbers are checked by one sum
SMALL = 1000

#: A vector whose entries are all smaller than this has no direction.
LEAST_DIRECTION = 1e-12


def real_array(field: str, value: Any, shape: tuple[int, ...] | None = None, *, finite: bool = True) -> Array:
    """A float64 copy of ``value`` with the given shape; int, float32, lists and tuples are welcome."""
    try:
        raw = np.asarray(value)
        if raw.dtype.kind not in "iufb":
            raise TypeError(raw.dtype)
        out = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ShapeError(field, value, "expected real numbers") from error
    if shape is not None and out.shape != shape:
        raise ShapeError(field, value, f"expected shape {shape}, not {out.shape}")
    # A byte of 0 is a False; every value that a user sets comes through here, and all() takes four times as long
    if finite and b"\0" in np.isfinite(out).tobytes():
        raise NotFiniteError(field, value, "expected finite numbers")
    return out


def dimensions(field: str, value: Any) -> tuple[int, ...]:
    """Shape of an array-like.

    Raises:
        ShapeError: its rows are of different lengths.
    """
    try:
        return np.shape(value)
    except ValueError as error:
        raise ShapeError(field, value, "expected rows of one length") from error


def bound_text(value: float, towards: int, digits: int = 6) -> str:
    """Digits of a bound that, read back, lie on its allowed side: below it (towards = -1) or above it (1)."""
    text = f"{value:.{digits}g}"
    if towards * float(text) >= towards * value:
        return text
    import decimal

    context = decimal.Context(prec=digits, rounding=decimal.ROUND_FLOOR if towards < 0 else decimal.ROUND_CEILING)
    return f"{float(context.create_decimal_from_float(float(value))):.{digits}g}"


def scalar(
    field: str,
    value: Any,
    *,
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
    unit: str = "",
) -> float:
    """A finite float within [low, high], or (low, high] with ``open_low``, and of a size whose products are numbers:
    at most 1e60, and 1e-60 at least where it must be above 0.
    """
    if type(value) is float and low < value < high and -LARGEST < value < LARGEST:  # noqa: SIM102 (the usual first)
        if value > SMALLEST or not open_low:
            return value
    number = float(real_array(field, value, ()))
    bad = number <= low if open_low else number < low
    if bad or number > high:
        left = "(" if open_low else "["
        raise RangeError(field, value, f"expected a value in {left}{low:g}, {high:g}] {unit}".rstrip())
    if abs(number) > LARGEST:
        raise RangeError(field, value, f"expected at most {LARGEST:g} {unit}".rstrip() + " in size")
    if open_low and low == 0.0 and number < SMALLEST:
        raise RangeError(field, value, f"expected at least {SMALLEST:g} {unit}".rstrip())
    return number


def own_scalars(
    owner: Any,
    *names: str,
    infinite: bool = False,
    low: float = -np.inf,
    high: float = np.inf,
    open_low: bool = False,
    unit: str = "",
) -> None:
    """Fields of a frozen dataclass become what :func:`scalar` makes of them, or an error that names class and field;
    with ``infinite`` they may be infinity.
    """
    for name in names:
        value = getattr(owner, name)
        if not (infinite and isinstance(value, float) and value == np.inf):
            field = f"{type(owner).__name__}.{name}"
            value = scalar(field, value, low=low, high=high, open_low=open_low, unit=unit)
        object.__setattr__(owner, name, value)


def ordinary_array(field: str, value: Any, shape: tuple[int, ...] | None = None, *, finite: bool = True) -> Array:
    """:func:`real_array` of numbers whose products are numbers: finite ones are at most 1e60 in size."""
    # The usual first: a small array of numbers whose squares add up to a number, which no NaN does
    usual = type(value) is np.ndarray and value.dtype == np.float64 and value.size < SMALL
    if usual and shape in (None, value.shape):  # noqa: SIM102 (the usual first)
        if np.vdot(value, value) < LARGEST:
            copied: Array = value.copy("K")
            return copied
    out = real_array(field, value, shape, finite=finite)
    large = np.abs(out) > LARGEST
    if not finite:
        large &= np.isfinite(out)
    if large.any():
        raise RangeError(field, value, f"expected numbers of at most {LARGEST:g} in size")
    return out


def unit_vector(field: str, value: Any) -> Array:
    """A vector in space scaled to unit length.

    Raises:
        ShapeError, NotFiniteError: not three finite numbers. RangeError: of no length.
    """
    vector = real_array(field, value, (3,))
    largest = float(np.abs(vector).max())
    if not largest > LEAST_DIRECTION:
        raise RangeError(field, value, "expected a direction: a vector of non-zero length")
    vector = vector / largest  # whatever its size, its square neither overflows nor vanishes
    out: Array = vector / np.linalg.norm(vector)
    return out


def flag(field: str, value: Any) -> bool:
    """A bool; 0 and 1 are accepted, other values are not."""
    if isinstance(value, (bool, np.bool_)) or (isinstance(value, (int, np.integer)) and int(value) in (0, 1)):
        return bool(value)
    raise ShapeError(field, value, "expected True or False")


def one_of(field: str, value: Any, choices: Iterable[str]) -> str:
    """A name out of ``choices``."""
    names = tuple(choices)
    if not isinstance(value, str) or value not in names:
        raise UnknownNameError(field, value, names)
    return value


class Entries(dict[str, T]):
    """What is known of each name of ``field``: another name is no KeyError, but raises an UnknownNameError."""

    def __init__(self, field: str, entries: Mapping[str, T]) -> None:
        super().__init__(entries)
        self.field = field

    def __missing__(self, name: Any) -> T:
        raise UnknownNameError(self.field, name, self)


def instance(field: str, value: Any, kind: type[T] | tuple[type[T], ...], expected: str) -> T:
    """An object of a class, or of one of several; ``expected``: what to say of it."""
    if not isinstance(value, kind):
        raise ShapeError(field, value, f"expected {expected}")
    return value


def items(field: str, value: Any, expected: str = "items") -> tuple[Any, ...]:
    """What a sequence or another iterable holds; neither text nor a mapping is one."""
    try:
        if not isinstance(value, (str, bytes, Mapping, type)):
            return tuple(value)
    except TypeError:
        pass
    raise ShapeError(field, value, f"expected a sequence of {expected}")


def name(field: str, value: Any) -> str:
    """Text that is not empty and that files and other languages can hold."""
    try:
        if isinstance(value, str) and value.encode():
            return value
    except UnicodeEncodeError:
        pass
    raise ShapeError(field, value, "expected a name that is not empty")


def strings(field: str, value: Any) -> tuple[str, ...]:
    """Several strings."""
    out = items(field, value, "strings")
    if not all(isinstance(item, str) for item in out):
        raise ShapeError(field, value, "expected strings")
    return out


def mapping(field: str, value: Any, expected: str = "names to values") -> dict[str, Any]:
    """A copy of a mapping whose keys are strings."""
    if not isinstance(value, Mapping) or not all(isinstance(key, str) for key in value):
        raise ShapeError(field, value, f"expected a mapping of {expected}")
    return dict(value)


def integer(field: str, value: Any, low: int = 0, high: int = 2**31 - 1) -> int:
    """A whole number within [low, high]."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)):
        raise ShapeError(field, value, "expected an integer")
    if not low <= value <= high:
        unbounded = value < low and high == 2**31 - 1
        raise RangeError(field, value, f"expected {low} or more" if unbounded else f"expected {low} to {high}")
    return int(value)


def function(field: str, value: Any) -> None:
    """Something that can be called, or None where it is left out."""
    if value is not None and not callable(value):
        raise ShapeError(field, value, "expected a function")


def called(field: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """What a user's function answers.

    Raises:
        WbcError: it raised; what it raised is the cause, unless it is such an error itself.
    """
    try:
        return function(*arguments)
    except WbcError:
        raise
    except Exception as error:
        raise WbcError(field, function, f"the function raised {type(error).__name__}: {error}") from error


def file_path(field: str, value: Any) -> pathlib.Path:
    """A path that the file system can be asked for."""
    try:
        path = pathlib.Path(value)
        os.fsencode(path)
    except (TypeError, UnicodeError) as error:
        raise ShapeError(field, value, "expected a path: a str or os.PathLike") from error
    if "\0" in str(path):
        raise ShapeError(field, value, "a path holds no null character")
    return path


def is_file(field: str, value: Any) -> bool:
    """Whether there is a file of this name; a name that is too long for one is none."""
    try:
        return file_path(field, value).is_file()
    except OSError:
        return False


def exists(field: str, value: Any) -> bool:
    """Whether there is a file or folder of this name; a name that is too long for one is none."""
    try:
        return file_path(field, value).exists()
    except OSError:
        return False


def existing(field: str, value: Any, refusal: type[WbcError]) -> pathlib.Path:
    """The path of a file or folder; what is not there is the caller's error."""
    path = file_path(field, value)
    if not exists(field, path):
        raise refusal(field, str(path), no_such(path, "there is no such file or folder"))
    return path


@contextlib.contextmanager
def writing(field: str, file: Any, refusal: type[WbcError], *also: type[Exception]) -> Iterator[None]:
    """A file or folder that is written within; what the file system refuses, or ``also``, is raised as the caller's."""
    refused: tuple[type[Exception], ...] = (OSError, *also)
    try:
        yield
    except refused as error:
        raise refusal(field, str(file), f"cannot be written: {getattr(error, 'strerror', None) or error}") from error


@contextlib.contextmanager
def replacing(
    field: str, file: pathlib.Path, refusal: type[WbcError], *also: type[Exception]
) -> Iterator[pathlib.Path]:
    """Where to write a file or folder that takes its place when it is whole: no reader meets half of it, and nothing
    is left of what fails, as of :func:`writing`.
    """
    # The name's end is its format
    fresh = file.with_name(f".{os.getpid()}.{file.name}")
    with writing(field, file, refusal, *also):
        try:
            yield fresh
            fresh.replace(file)
        finally:
            if fresh.is_dir():
                import shutil

                shutil.rmtree(fresh, ignore_errors=True)
            with contextlib.suppress(OSError):
                fresh.unlink(missing_ok=True)


def text_of(field: str, file: Any, refusal: type[WbcError]) -> str:
    """What a text file holds; one that is missing, is no text or cannot be read is the caller's error."""
    path = file_path(field, file)
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise refusal(field, str(path), no_such(path)) from error
    except (OSError, UnicodeDecodeError) as error:
        raise refusal(field, str(path), f"cannot be read: {error}") from error


def no_such(path: str | os.PathLike[str], reason: str = "there is no such file") -> str:
    """The reason why a file or folder that is not there is refused, with the nearest name in its folder."""
    # Imported for a mistake only
    import difflib

    place = pathlib.Path(path)
    try:
        near = [] if place.exists() else difflib.get_close_matches(place.name, os.listdir(place.parent), 1)
    except OSError:
        near = []
    return f"{reason}, did you mean {str(place.with_name(near[0]))!r}?" if near else reason


def rotation(field: str, value: Any) -> Array:
    """A 3x3 rotation matrix, from a matrix or from a unit quaternion (x, y, z, w)."""
    raw = real_array(field, value)
    if raw.shape == (4,):
        norm = float(np.linalg.norm(raw))
        if abs(norm - 1.0) > ROTATION_TOLERANCE:
            raise RotationError(field, value, f"quaternion x, y, z, w of norm {norm:.9g}, expected 1")
        return np.asarray(own.Quaternion(raw / norm).matrix(), dtype=np.float64)
    if raw.shape != (3, 3):
        raise ShapeError(field, value, f"expected a 3x3 rotation or a quaternion (x, y, z, w), not shape {raw.shape}")
    if not _is_rotation(raw.ravel().tolist()):
        off = float(np.linalg.norm(raw.T @ raw - np.eye(3)))
        raise RotationError(
            field, value, f"not a rotation matrix (|R'R - 1| = {off:.3g}, det = {np.linalg.det(raw):.3g})"
        )
    return raw


def pose(field: str, value: Any) -> pin.SE3:
    """A pose, from ``pin.SE3``, a 4x4 homogeneous matrix, seven numbers (position, quaternion x, y, z, w), or a pair.

    A pair is a position with a quaternion or with a 3x3 rotation matrix.
    """
    placed = own_pose(field, value)
    return pin.SE3(placed.rotation, placed.translation)


def own_pose(field: str, value: Any) -> own.SE3:
    """As :func:`pose`, as this package's own."""
    if is_pose(value):
        return own.SE3(rotation(field, value.rotation), real_array(field, value.translation, (3,)))
    if isinstance(value, (tuple, list)) and len(value) == 2:
        return own.SE3(rotation(field, value[1]), real_array(field, value[0], (3,)))
    raw = real_array(field, value)
    if raw.shape == (7,):
        return own.SE3(rotation(field, raw[3:]), raw[:3])
    if raw.shape == (4, 4):
        if not np.array_equal(raw[3], (0.0, 0.0, 0.0, 1.0)):
            raise RotationError(field, value, "last row of a homogeneous matrix must be 0, 0, 0, 1")
        return own.SE3(rotation(field, raw[:3, :3]), raw[:3, 3])
    raise ShapeError(field, value, "expected a pin.SE3, a 4x4 matrix or (position, quaternion x, y, z, w)")


def pose_numbers(field: str, value: Any) -> Array:
    """A pose as 12 numbers, rotation by columns, then position; from whatever :func:`pose` takes."""
    matrix = value if type(value) is np.ndarray or not is_pose(value) else value.homogeneous
    if type(matrix) is np.ndarray and matrix.shape == (4, 4) and matrix.dtype == np.float64:
        # The columns of the upper three rows are those of the rotation, then the position
        numbers: Array = matrix[:3].ravel(order="F")
        *nine, x, y, z = numbers.tolist()
        finite = math.isfinite(x) and math.isfinite(y) and math.isfinite(z)
        if finite and _is_rotation(nine) and matrix[3].tolist() == [0.0, 0.0, 0.0, 1.0]:
            return numbers
    return np.ravel(own_pose(field, value).homogeneous[:3], order="F")


def _is_rotation(numbers: list[float]) -> bool:
    """Whether |R'R - I| <= ROTATION_TOLERANCE and det R > 0, for R by rows or by columns; False for NaN.

    In plain floats: targets are set every tick, and nine numbers are too few for numpy to be quick.
    """
    a, b, c, d, e, f, g, h, i = numbers
    xx, yy, zz = a * a + b * b + c * c - 1.0, d * d + e * e + f * f - 1.0, g * g + h * h + i * i - 1.0
    xy, xz, yz = a * d + b * e + c * f, a * g + b * h + c * i, d * g + e * h + f * i
    square = xx * xx + yy * yy + zz * zz + 2.0 * (xy * xy + xz * xz + yz * yz)
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    return square <= ROTATION_TOLERANCE**2 and determinant > 0.0
