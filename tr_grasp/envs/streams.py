"""Independent streams of random numbers, all from the seed of one episode."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Who draws; a new randomiser gets a new number, so that it changes nothing for the others."""

    SCENE = 0
    """How many objects, which, and of what mass and friction."""
    EPISODE = 1
    """How the objects drop, the arm's joints, Gaussian depth noise."""
    CAMERA_POSE = 2
    GRAVITY = 3
    LATENCY = 4
    STEREO_NOISE = 5
    GROUND_TEXTURE = 6
    TABLE_COLOUR = 7
    OBJECT_TINT = 8
    LIGHT = 9


def stream(episode_seed: int, which: Stream) -> np.random.Generator:
    """The generator of one stream of an episode, at its beginning."""
    return np.random.default_rng([episode_seed, int(which)])


def uniform_or_middle(range_: tuple[float, float], rng: np.random.Generator, *, uniform: bool) -> float:
    """A uniform number of a range, or its middle; drawn all the same, so that what is drawn next stays what it is."""
    drawn = float(rng.uniform(*range_))
    return drawn if uniform else sum(range_) / 2
