"""How an object is turned before it is let go."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.geometry import random_wxyz

Orientation = Literal["upright_yaw", "uniform", "thesis"]


def random_orientation(kind: Orientation, rng: np.random.Generator) -> NDArray[np.floating]:
    """A unit quaternion ``(4,)`` in the order w, x, y, z.

    Args:
        kind: ``uniform`` over all rotations; ``thesis``, a normalised vector of four numbers in [-1, 1], which
            makes rotations towards the corners of that cube up to 16 times as likely as those towards its faces;
            ``upright_yaw``, standing as modelled and turned about the vertical.
        rng: What is random.

    Raises:
        ConfigError: There is no such kind.
    """
    if kind == "uniform":
        return random_wxyz(rng)
    if kind == "upright_yaw":
        half_turn = rng.uniform(-np.pi, np.pi) / 2
        return np.array([np.cos(half_turn), 0.0, 0.0, np.sin(half_turn)])
    if kind == "thesis":
        q = rng.uniform(-1.0, 1.0, 4)
        return q / np.linalg.norm(q)
    raise ConfigError(unknown_name("objects.orientation", kind, get_args(Orientation)))
