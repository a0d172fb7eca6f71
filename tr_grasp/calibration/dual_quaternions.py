"""Hand-eye calibration with dual quaternions, after Daniilidis, safe from motions of nearly half a turn.

OpenCV's solver of that name gives the same, except where noise gives the two quaternions of a motion of nearly half a
turn opposite signs: then its answer can be off by metres. Here a solution without those motions decides their signs.

Source: K. Daniilidis, Hand-eye calibration using dual quaternions, International Journal of Robotics Research 18, 1999.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from tr_grasp.calibration.rigid import Array
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import invert_transform, matrix_from_wxyz, transform_from, wxyz_from_matrix

CLEAR_TURN_DEG = 160.0
"""Up to here both quaternions of a motion have the same sign when their real parts are positive, in spite of noise."""


def solve_dual_quaternions(hand: Array, seen: Array) -> Array:
    """``X`` (4, 4) with ``hand_i X seen_i`` the same for all samples i, from all pairs of them.

    Args:
        hand: (n, 4, 4) poses, in a frame that stands still, of the one that X is in.
        seen: (n, 4, 4) poses of the board in the camera.

    Raises:
        CalibrationError: Too few motions that turn by less than 160 degrees, or all about parallel axes.
    """
    first, second = np.array(list(combinations(range(len(hand)), 2))).reshape(-1, 2).T
    A = invert_transform(hand[second]) @ hand[first]
    B = seen[second] @ invert_transform(seen[first])
    a, b = _dual_quaternions(A), _dual_quaternions(B)
    clear = np.minimum(a[:, 0], b[:, 0]) > np.cos(np.radians(CLEAR_TURN_DEG) / 2)
    if clear.sum() < 2:
        raise CalibrationError(
            f"dual quaternions need two motions that turn by less than {CLEAR_TURN_DEG:.0f} degrees, got "
            f"{clear.sum()}; take more samples, or the method 'park'."
        )
    X = _solve(a[clear], b[clear])
    if clear.all():
        return X
    expected = np.concatenate([a[:, :1], a[:, 1:4] @ X[:3, :3]], axis=1)
    b[(expected * b[:, :4]).sum(1) < 0] *= -1
    return _solve(a, b)


def _solve(a: Array, b: Array) -> Array:
    """(4, 4) from dual quaternions (n, 8) of motions, equal signs within each pair."""
    _, values, V = np.linalg.svd(_equations(a, b))
    if values[5] < 1e-9 * values[0]:
        raise CalibrationError("all rotations are about parallel axes; turn the hand about another axis too.")
    return _transform(_unit_combination(V[6], V[7]))


def _dual_quaternions(T: Array) -> Array:
    """(n, 8) of transforms: the rotation's quaternion (real part not negative), and half of translation times it."""
    q = wxyz_from_matrix(T[:, :3, :3])
    w, v, t = q[:, :1], q[:, 1:], T[:, :3, 3]
    dual = np.concatenate([-(t * v).sum(1, keepdims=True), w * t + np.cross(t, v)], axis=1) / 2
    return np.concatenate([q, dual], axis=1)


def _equations(a: Array, b: Array) -> Array:
    """(6 n, 8) that vanish on X's dual quaternion: ``a x = x b`` without its scalar rows, which say nothing new."""
    M = np.zeros((len(a), 6, 8))
    M[:, :3, :4] = M[:, 3:, 4:] = _commutation(a[:, 1:4], b[:, 1:4])
    M[:, 3:, :4] = _commutation(a[:, 5:], b[:, 5:])
    return M.reshape(-1, 8)


def _commutation(a: Array, b: Array) -> Array:
    """(n, 3, 4) vector part of ``a q - q b`` for vectors a and b and a quaternion q."""
    x, y, z = (a + b).T
    zero = np.zeros_like(x)
    turned = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    return np.concatenate([(a - b)[:, :, None], turned], axis=2)


def _unit_combination(u: Array, v: Array) -> Array:
    """The combination of two null vectors (8,) that is a unit dual quaternion; of two, the one that is longer."""
    a, b, c = u[:4] @ u[4:], u[:4] @ v[4:] + u[4:] @ v[:4], v[:4] @ v[4:]
    # Its real and dual parts must be orthogonal: a s² + b s + c = 0 with s the share of u for each v.
    root = np.sqrt(max(b * b - 4 * a * c, 0.0))
    half = -0.5 * (b + np.copysign(root, b))
    # Pairs (share of u, share of v) solve it also where a or c is nearly zero.
    candidates = [q for q in (half * u + a * v, c * u + half * v) if np.linalg.norm(q[:4]) > 1e-12]
    if not candidates:
        raise CalibrationError("dual quaternions determine nothing from these samples; take more, or another method.")
    longest = max(candidates, key=lambda q: float(np.linalg.norm(q[:4]) / np.linalg.norm(q)))
    return longest / np.linalg.norm(longest[:4])


def _transform(x: Array) -> Array:
    """(4, 4) of a unit dual quaternion (8,)."""
    (w, v), (dw, dv) = (x[0], x[1:4]), (x[4], x[5:])
    # The translation is twice the dual part times the conjugate of the real one.
    t = 2 * (w * dv - dw * v - np.cross(dv, v))
    return transform_from(matrix_from_wxyz(x[:4]), t)
