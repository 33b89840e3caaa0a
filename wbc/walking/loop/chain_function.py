"""The pose at which the held hands fit their holds best, as one expression of the joints: computed in every tick."""

from __future__ import annotations

import weakref
from itertools import combinations

import casadi as ca
import numpy as np
import pinocchio as pin

from wbc.native.compiled_function import compiled
from wbc.robots import Walker
from wbc.symbolic.kinematics import Kinematics
from wbc.symbolic.rotations import from_quaternion

#: Sweeps of Jacobi's rotations; four are enough for a matrix of four rows, more change nothing
SWEEPS = 6
#: Keeps 0 / 0 away where a matrix is diagonal
TINY = 1e-300

_KNOWN: weakref.WeakKeyDictionary[object, ca.Function] = weakref.WeakKeyDictionary()


def chain_function(walker: Walker) -> ca.Function:
    """f(q, v, dt, weights, mean, centre, mask, holds): see :class:`wbc.walking.loop.closed_chain.ClosedChain`.

    The joints move on from q by v dt. Of n arms, with 3 n rows of numbers for origins, z axes and x axes of the hands:
    ``weights`` ``[9 n]`` by rows, ``mean`` ``[n]``, ``centre`` ``[3]`` [m], ``mask`` ``[n]``, ``holds`` ``[3 n]`` [m].

    Returns:
        q with the joints moved on and the body where the holds have it, its quaternion with the sign nearest to the one
        given; the slip [m]; and the 3 n rows in the structure ``[9 n]``.
    """
    known = _KNOWN.get(walker.robot)
    if known is None:
        known = _KNOWN[walker.robot] = compiled(_function(walker))
    return known


def _function(walker: Walker) -> ca.Function:
    n, rows = len(walker.arms), _hands(walker)
    q, v, dt = ca.SX.sym("q", walker.robot.nq), ca.SX.sym("v", walker.robot.nv), ca.SX.sym("dt")
    joints = q[7:] + v[6:] * dt
    sizes = {"weights": 9 * n, "mean": n, "centre": 3, "mask": n, "holds": 3 * n}
    weights, mean, centre, mask, holds = (ca.SX.sym(name, size) for name, size in sizes.items())
    ours = ca.reshape(rows(joints), 3, 3 * n).T
    quaternion = largest(davenport(ca.reshape(weights, 3, 3 * n) @ ours))
    quaternion = ca.if_else(ca.dot(quaternion, q[3:7]) < 0.0, -quaternion, quaternion)
    moved = ours @ from_quaternion(quaternion).T
    place = centre - moved[:n, :].T @ mean
    moved[:n, :] += ca.repmat(place.T, n, 1)
    gaps = moved[:n, :] - ca.reshape(holds, 3, n).T
    slip = ca.sqrt(ca.mmax(mask * ca.sum2(gaps**2)))
    out = ca.vertcat(place, quaternion, joints, slip, ca.vec(moved.T))
    return ca.Function("chain", [q, v, dt, weights, mean, centre, mask, holds], [out])


def _hands(walker: Walker) -> ca.Function:
    """Origins, z axes and x axes of the hands in the body's frame, from the joints."""
    model = walker.robot.model
    kinematics = Kinematics(model)
    poses = [kinematics.pose(arm.hand) for arm in walker.arms]
    rows = [pose.position for pose in poses] + [pose.rotation[:, k] for k in (2, 0) for pose in poses]
    joints = ca.SX.sym("joints", model.nq - 7)
    still = ca.vertcat(*np.array(pin.neutral(model))[:7].tolist(), joints)
    return ca.Function("hands", [joints], [ca.substitute(ca.vertcat(*rows), kinematics.q, still)])


def davenport(a: ca.SX) -> ca.SX:
    """K of A for quaternions (x, y, z, w): tr(R' A) = q' K q.

    K_vv = A + A' - tr(A) 1,    K_vw = (A32 - A23, A13 - A31, A21 - A12),    K_ww = tr(A)
    """
    trace, across = ca.trace(a), ca.vertcat(a[2, 1] - a[1, 2], a[0, 2] - a[2, 0], a[1, 0] - a[0, 1])
    return ca.blockcat([[a + a.T - trace * ca.SX.eye(3), across], [across.T, trace]])


def largest(matrix: ca.SX) -> ca.SX:
    """The unit eigenvector of the largest eigenvalue of a symmetric matrix, by Jacobi's rotations."""
    count = matrix.size1()
    a, vectors = ca.densify(ca.SX(matrix)), ca.densify(ca.SX.eye(count))
    for _ in range(SWEEPS):
        for i, j in combinations(range(count), 2):
            _rotate(a, vectors, i, j)
    best, value = vectors[:, 0], a[0, 0]
    for k in range(1, count):
        best = ca.if_else(a[k, k] > value, vectors[:, k], best)
        value = ca.fmax(a[k, k], value)
    return best / ca.norm_2(best)


def _rotate(a: ca.SX, vectors: ca.SX, i: int, j: int) -> None:
    """Turn rows and columns i and j so that a_ij becomes 0, by the smaller of the two angles."""
    apart, off = a[j, j] - a[i, i], a[i, j]
    size = ca.fabs(apart) + ca.sqrt(apart * apart + 4.0 * off * off) + TINY
    tangent = ca.if_else(apart < 0.0, -2.0, 2.0) * off / size
    cosine = 1.0 / ca.sqrt(1.0 + tangent * tangent)
    sine = tangent * cosine
    a[i, i], a[j, j] = a[i, i] - tangent * off, a[j, j] + tangent * off
    a[i, j] = a[j, i] = 0.0
    for k in set(range(a.size1())) - {i, j}:
        one, other = a[k, i], a[k, j]
        a[k, i] = a[i, k] = cosine * one - sine * other
        a[k, j] = a[j, k] = sine * one + cosine * other
    one, other = vectors[:, i], vectors[:, j]
    vectors[:, i], vectors[:, j] = cosine * one - sine * other, sine * one + cosine * other
