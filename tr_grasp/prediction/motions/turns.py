"""Targets that go straight and turn, at constant speed."""

from __future__ import annotations

import torch
from torch import Tensor

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.motions.state import TargetState, Value, clock, number, positive, stack, state


def random_turns(
    t: Value,
    *,
    speed_m_s: Value,
    start_m: Tensor,
    heading_rad: Value,
    lengths_m: Tensor,
    curvatures_1_m: Tensor,
    yaw_rad: Value = 0.0,
) -> TargetState:
    """Pieces of constant curvature, one after the other without a kink, at constant speed.

    Args:
        t: Time [s]; before 0 the target waits at the start, after the end it stands there.
        speed_m_s: Speed on the path.
        start_m: (*batch, 3), base frame.
        heading_rad: Direction of travel at the start.
        lengths_m: (*batch, pieces) Length of every piece.
        curvatures_1_m: (*batch, pieces) 1 / radius of every piece, positive to the left, 0 for straight on.
        yaw_rad: Heading of the object, which does not change.

    Raises:
        PredictionError: A speed or length that is not positive, or pieces of two shapes.
    """
    speed, lengths = positive("speed_m_s", speed_m_s), positive("lengths_m", lengths_m)
    curvatures, start = number(curvatures_1_m), number(start_m)
    if lengths.shape != curvatures.shape or not lengths.ndim or start.shape[-1:] != (3,):
        raise PredictionError(
            "lengths_m and curvatures_1_m must be (*batch, pieces) and start_m (*batch, 3), got "
            f"{tuple(lengths.shape)}, {tuple(curvatures.shape)} and {tuple(start.shape)}."
        )
    time = clock(t, lengths.sum(-1) / speed)
    ends = lengths.cumsum(-1)
    # What was travelled of every piece: none, part, or all.
    done = torch.minimum((time.elapsed_s * speed).unsqueeze(-1).clamp(min=0.0) - (ends - lengths), lengths).clamp(
        min=0.0
    )
    turned = curvatures * done
    headings = number(heading_rad).unsqueeze(-1) + turned.cumsum(-1) - turned
    # A chord is the arc times sinc(half its angle), and lies half that angle off the heading at its start.
    chord, direction = done * torch.sinc(turned / 2 / torch.pi), headings + turned / 2
    position = start + stack((chord * direction.cos()).sum(-1), (chord * direction.sin()).sum(-1), 0.0)
    heading = number(heading_rad) + turned.sum(-1)
    velocity = stack(speed * heading.cos(), speed * heading.sin(), 0.0)
    return state(time, position, velocity, number(yaw_rad))
