"""Targets on a cubic Bézier curve, at constant speed."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.motions.state import TargetState, Value, clock, number, positive, state

_NODES, _WEIGHTS = (torch.from_numpy(array) for array in np.polynomial.legendre.leggauss(32))
_NEWTON_STEPS = 6


def bezier(t: Value, *, speed_m_s: Value, control_points_m: Tensor, yaw_rad: Value = 0.0) -> TargetState:
    """A cubic Bézier curve, followed at constant speed from its first control point to its last.

    Args:
        t: Time [s]; before 0 the target waits at the start, after the end it stands there.
        speed_m_s: Speed on the curve.
        control_points_m: (*batch, 4, 3), base frame; no two neighbours may coincide.
        yaw_rad: Heading of the object, which does not change.

    Raises:
        PredictionError: A speed that is not positive, or control points of another shape.
    """
    points = number(control_points_m)
    if points.shape[-2:] != (4, 3):
        raise PredictionError(f"control_points_m must be (*batch, 4, 3), got {tuple(points.shape)}.")
    speed = positive("speed_m_s", speed_m_s)
    time = clock(t, arc_length(points, torch.ones((), dtype=torch.float64)) / speed)
    u = _parameter(points, time.elapsed_s * speed)
    tangent = _derivative(points, u)
    velocity = speed.unsqueeze(-1) * tangent / tangent.norm(dim=-1, keepdim=True)
    return state(time, _curve(points, u), velocity, number(yaw_rad))


def arc_length(points: Tensor, u: Tensor) -> Tensor:
    """Length (*batch) of curves (*batch, 4, 3) from their start to ``u`` (*batch) in [0, 1], by Gauss' quadrature."""
    half = u / 2
    nodes = half.unsqueeze(-1) * (_NODES + 1)
    return half * (_WEIGHTS * _derivative(points.unsqueeze(-3), nodes).norm(dim=-1)).sum(-1)


def _parameter(points: Tensor, length: Tensor) -> Tensor:
    """The parameter in [0, 1] at which a curve has that length, by Newton's method; gradients follow the inverse."""
    with torch.no_grad():
        whole = arc_length(points, torch.ones((), dtype=torch.float64))
        u = (length / whole).clamp(0.0, 1.0)
        for _ in range(_NEWTON_STEPS):
            u = (u - (arc_length(points, u) - length) / _derivative(points, u).norm(dim=-1)).clamp(0.0, 1.0)
    # One more step, this time with gradient: its derivative is that of the inverse function.
    return (u - (arc_length(points, u) - length) / _derivative(points, u).norm(dim=-1)).clamp(0.0, 1.0)


def _curve(points: Tensor, u: Tensor) -> Tensor:
    p0, p1, p2, p3 = points.unbind(-2)
    u = u.unsqueeze(-1)
    return (1 - u) ** 3 * p0 + 3 * (1 - u) ** 2 * u * p1 + 3 * (1 - u) * u**2 * p2 + u**3 * p3


def _derivative(points: Tensor, u: Tensor) -> Tensor:
    first, second, third = (points[..., 1:, :] - points[..., :-1, :]).unbind(-2)
    u = u.unsqueeze(-1)
    return 3 * ((1 - u) ** 2 * first + 2 * (1 - u) * u * second + u**2 * third)
