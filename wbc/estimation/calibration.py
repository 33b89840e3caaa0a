"""Frame, scale and delay of a measuring device from what it read while its target moved along known positions.

A device reads y where the target is at x(t):

    y(t) = M x(t - delay) + b + noise

    rigid        M = R               a rotation: the device's axes
    similarity   M = s R             and one scale
    affine       M any 3 x 3         a scale and a tilt for each axis

The parameters minimise the sum of squares: Gauss-Newton from the best of the closed forms for M and b at many delays;
with x a cubic spline through the known positions, dx/dt is exact for it. Readings from beside the path do not count.
Covariance: sigma^2 (J'J)^-1, sigma^2 from the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from wbc import validation
from wbc.errors import RangeError, SolverError
from wbc.multibody import pin
from wbc.validation import Array

Kind = Literal["rigid", "similarity", "affine"]
#: M, b and the delay
Parameters = tuple[Array, Array, float]
KINDS = ("rigid", "similarity", "affine")
#: Least singular value of the Jacobian with columns of unit length, below which data do not tell parameters apart
EXCITED = 1e-3
#: Gauss-Newton steps at most
STEPS = 50
#: Relative change of the parameters at which the steps end
SETTLED = 1e-12
#: Delays from which the search may begin are at most this long [s]
LATEST = 2.0
#: Of the recording: they are at most this part of its time, so that most readings count
EDGE = 0.25
#: How many they are, either way and none
DELAYS = 161


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was found.

    Attributes:
        matrix, offset: M and b. delay: [s], 0 where it was not asked for.
        names: of the parameters, in the order of the covariance: turns [rad] about the axes of the readings, or the
            entries of M; scale; offsets [m]; delay [s].
        covariance: of the parameters. residual: root of the mean square of what is left, per axis [m].
    """

    matrix: Array
    offset: Array
    delay: float
    names: tuple[str, ...]
    covariance: Array
    residual: Array

    @property
    def rotation(self) -> Array:
        """The rotation nearest to M: the reference's axes as the device sees them."""
        left, _, right = np.linalg.svd(self.matrix)
        return np.array(left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right)

    @property
    def scales(self) -> Array:
        """Length that the device reads for a metre along each reference axis."""
        return np.array(np.linalg.norm(self.matrix, axis=0))

    @property
    def tilts(self) -> Array:
        """Angle between each reference axis and what the device reads for it, with :attr:`rotation` not taken out
        [rad].
        """
        return np.arccos(np.clip(np.diag(self.matrix) / self.scales, -1.0, 1.0))

    def deviation(self, name: str) -> float:
        """Standard deviation of a parameter.

        Raises:
            UnknownNameError: no such parameter.
        """
        k = self.names.index(validation.one_of("parameter", name, self.names))
        return float(np.sqrt(self.covariance[k, k]))

    def position(self, reading: Any) -> Array:
        """Where the target was, from a reading [3] or many [n, 3]: M^-1 (y - b)."""
        given = validation.real_array("reading", reading)
        return np.array(np.linalg.solve(self.matrix, (given - self.offset).T).T)

    def pose(self, reading: Any) -> pin.SE3:
        """The same of a pose, whose axes are turned back by :attr:`rotation`."""
        given = validation.pose("reading", reading)
        return pin.SE3(self.rotation.T @ given.rotation, self.position(given.translation))


def calibrate(times: Any, readings: Any, positions: Any, kind: Kind = "affine", delay: bool = True) -> Calibration:
    """Calibrate a device, see the module.

    Args:
        times: increasing [s], count. readings, positions: the device's and the true ones [m], count x 3, at these.
        kind: what M may be. delay: whether the device's delay is sought, too, up to 2 s and a quarter of the recording
            either way; without it no time enters.

    Raises:
        ShapeError, NotFiniteError, RangeError, UnknownNameError: bad input.
        SolverError: motion that does not excite a parameter, which is named; or no convergence.
    """
    validation.one_of("kind", kind, KINDS)
    x = validation.real_array("positions", positions)
    x = validation.real_array("positions", x, (len(x) if x.ndim else 0, 3))
    y = validation.real_array("readings", readings, x.shape)
    t = validation.real_array("times", times, (len(x),))
    seek = validation.flag("delay", delay)
    names = _names(kind, seek)
    if 3 * len(x) <= len(names):
        raise RangeError("positions", len(x), f"{len(names)} parameters need more than {len(names) // 3} positions")
    if seek and (np.diff(t) <= 0.0).any():
        raise RangeError("times", times, "expected increasing times")
    path, data, parameters = None, (t, x, y), _start(kind, x, y)
    if seek:
        path = CubicSpline(t, x)
        data, parameters = _delayed_start(kind, path, data)
    for _ in range(STEPS):
        residual, jacobian = _linearised(kind, path, data, parameters)
        step = _solved(jacobian, residual, names)
        parameters = _moved(kind, parameters, step)
        if np.abs(step * np.linalg.norm(jacobian, axis=0)).max() <= SETTLED * np.linalg.norm(y - y.mean(axis=0)):
            break
    else:
        raise SolverError("calibrate", kind, f"no minimum in {STEPS} steps")
    residual, jacobian = _linearised(kind, path, data, parameters)
    variance = float(residual @ residual) / (len(residual) - len(names))
    covariance = np.array(variance * np.linalg.inv(jacobian.T @ jacobian), dtype=np.float64)
    left = np.sqrt(np.mean(residual.reshape(-1, 3) ** 2, axis=0))
    return Calibration(*parameters, names, covariance, left)


def _names(kind: Kind, delay: bool) -> tuple[str, ...]:
    turns = tuple(f"turn {axis}" for axis in "xyz")
    entries = tuple(f"M {row}{column}" for column in "xyz" for row in "xyz")
    own = {"rigid": turns, "similarity": (*turns, "scale"), "affine": entries}[kind]
    return (*own, *(f"offset {axis}" for axis in "xyz"), *(("delay",) if delay else ()))


def _start(kind: Kind, x: Array, y: Array) -> Parameters:
    """M and b without delay: least squares, or the nearest rotation and its scale (Umeyama 1991)."""
    middle, centre = x.mean(axis=0), y.mean(axis=0)
    if kind == "affine":
        matrix = np.linalg.lstsq(x - middle, y - centre, rcond=None)[0].T
    else:
        left, sizes, right = np.linalg.svd((y - centre).T @ (x - middle))
        signs = np.array([1.0, 1.0, np.linalg.det(left @ right)])
        matrix = left @ np.diag(signs) @ right
        if kind == "similarity" and (spread := float(((x - middle) ** 2).sum())) > 0.0:
            matrix = matrix * max(float(sizes @ signs) / spread, EXCITED)
    return matrix, centre - matrix @ middle, 0.0


def _delayed_start(kind: Kind, path: CubicSpline, data: tuple[Array, Array, Array]) -> tuple[Any, Parameters]:
    """The readings that lie on the path at the delay that leaves least of them, and the parameters there."""
    t, x, y = data
    begin, end = float(t[0]), float(t[-1])
    most = min(LATEST, EDGE * (end - begin))
    best, start = np.inf, (data, _start(kind, x, y))
    for late in sorted(np.linspace(-most, most, DELAYS), key=abs):
        on = (t - late >= begin) & (t - late <= end)
        place, reading = path(t[on] - late), y[on]
        matrix, offset, _ = _start(kind, place, reading)
        left = float(np.mean((reading - place @ matrix.T - offset) ** 2))
        if left < best:
            best, start = left, ((t[on], x[on], reading), (matrix, offset, float(late)))
    return start


def _linearised(
    kind: Kind, path: CubicSpline | None, data: tuple[Array, Array, Array], parameters: Parameters
) -> tuple[Array, Array]:
    """Residuals y - M x - b, point by point, and the Jacobian of M x + b by the parameters."""
    (t, x, y), (matrix, offset, late) = data, parameters
    place = x if path is None else path(t - late)
    seen = place @ matrix.T
    count = len(x)
    jacobian = np.zeros((count, 3, 0))
    if kind == "affine":
        jacobian = np.einsum("nc,rk->nrck", place, np.eye(3)).reshape(count, 3, 9)
    else:
        jacobian = np.array([-pin.skew(row) for row in seen])
        if kind == "similarity":
            jacobian = np.concatenate([jacobian, seen[:, :, None]], axis=2)
    parts = [jacobian, np.tile(np.eye(3), (count, 1, 1))]
    if path is not None:
        parts.append(-(path(t - late, 1) @ matrix.T)[:, :, None])
    return (y - seen - offset).ravel(), np.concatenate(parts, axis=2).reshape(3 * count, -1)


def _solved(jacobian: Array, residual: Array, names: tuple[str, ...]) -> Array:
    """The least-squares step, by columns of unit length."""
    lengths = np.linalg.norm(jacobian, axis=0)
    longest = lengths.max()
    unit = jacobian / np.where(lengths > EXCITED**2 * longest, lengths, np.inf)
    left, values, right = np.linalg.svd(unit, full_matrices=False)
    if values[-1] < EXCITED:
        blind = [names[k] for k in np.argsort(-np.abs(right[-1])) if abs(right[-1][k]) > 0.1]
        reason = f"the motion does not tell {', '.join(blind)} apart (excitation {values[-1]:.1e} of {EXCITED:g})"
        raise SolverError("calibrate", blind[0], reason)
    return np.array((right.T @ ((left.T @ residual) / values)) / lengths)


def _moved(kind: Kind, parameters: Parameters, step: Array) -> Parameters:
    """The parameters after a step."""
    matrix, offset, late = parameters
    if kind == "affine":
        matrix, rest = matrix + step[:9].reshape(3, 3, order="F"), step[9:]
    else:
        scale = np.exp(step[3]) if kind == "similarity" else 1.0
        matrix, rest = scale * pin.exp3(step[:3]) @ matrix, step[4 if kind == "similarity" else 3 :]
    return matrix, offset + rest[:3], late + (float(rest[3]) if len(rest) > 3 else 0.0)
