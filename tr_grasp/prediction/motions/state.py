"""Where a moving target is at one time, and the arithmetic that all motions share."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

import torch
from torch import Tensor

from tr_grasp.errors import PredictionError

Value: TypeAlias = Tensor | float
"""A number, or a tensor of them that broadcasts against the others."""


class TargetState(NamedTuple):
    """Pose and velocity of a target in the base frame; all float64."""

    position: Tensor
    """(*batch, 3) [m]."""
    velocity: Tensor
    """(*batch, 3) [m/s], the derivative of the position; zero before the start and after the end."""
    yaw: Tensor
    """(*batch) [rad] about the vertical, not wrapped."""
    yaw_rate: Tensor
    """(*batch) [rad/s]."""
    remaining_s: Tensor
    """(*batch) Time until it stops for good; at time 0, the duration of the motion."""


class Clock(NamedTuple):
    """Time along a motion that starts at 0 and ends."""

    elapsed_s: Tensor
    """Time since the start, kept between 0 and the end."""
    moves: Tensor
    """Whether it has started and not ended."""
    remaining_s: Tensor
    """Time until the end."""


def clock(t: Value, duration_s: Tensor) -> Clock:
    """The time along a motion, at any time ``t`` [s]; at the end itself it stands still."""
    now, duration_s = torch.broadcast_tensors(number(t), duration_s)
    elapsed_s = torch.minimum(now.clamp(min=0.0), duration_s)
    return Clock(elapsed_s, (now >= 0) & (now < duration_s), duration_s - elapsed_s)


def state(time: Clock, position: Tensor, velocity: Tensor, yaw: Tensor, yaw_rate: Value = 0.0) -> TargetState:
    """A state in which nothing moves while the clock stands; velocity and rate are those of the moving part."""
    shape = torch.broadcast_shapes(position.shape[:-1], time.moves.shape, yaw.shape)
    moves = time.moves.expand(shape)
    zero = position.new_zeros(())
    return TargetState(
        position.expand(*shape, 3),
        torch.where(moves.unsqueeze(-1), velocity, zero),
        yaw.expand(shape),
        torch.where(moves, number(yaw_rate), zero),
        time.remaining_s.expand(shape),
    )


def number(value: Value) -> Tensor:
    """A float64 tensor; gradients pass through."""
    return torch.as_tensor(value, dtype=torch.float64)


def positive(name: str, value: Value) -> Tensor:
    """A float64 tensor of positive numbers.

    Raises:
        PredictionError: One is not.
    """
    tensor = number(value)
    if not bool((torch.isfinite(tensor) & (tensor > 0)).all()):
        raise PredictionError(f"{name} must be positive, got {tensor.detach().flatten().tolist()[:8]}.")
    return tensor


def stack(x: Value, y: Value, z: Value) -> Tensor:
    """Coordinates (*batch, 3) from three that broadcast."""
    return torch.stack(torch.broadcast_tensors(number(x), number(y), number(z)), -1)


def turn(vectors: Tensor, angle_rad: Value) -> Tensor:
    """Vectors (*batch, 3) turned about the vertical by an angle (*batch)."""
    cosine, sine = number(angle_rad).cos(), number(angle_rad).sin()
    x, y, z = vectors.unbind(-1)
    return stack(cosine * x - sine * y, sine * x + cosine * y, z)
