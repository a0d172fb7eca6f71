"""Does the file act like the policy?"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from statistics import median
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict
from torch import Tensor

from tr_grasp.keys import ACTION, OCTREE, PROPRIO
from tr_grasp.modules.agent import Agent, EnvSpec
from tr_grasp.modules.export.formats import Runner
from tr_grasp.octree import OctreeFrame, OctreeSpec, count_octree_from_points

TOLERANCE = 1e-5
"""Largest difference of an action component that may be called rounding."""

MOST_POINTS = 3_000
MOST_CLUSTERS = 5
CLUSTER_SHARE = 0.12
"""Largest standard deviation of a cluster of points, as a share of the cube's edge."""


class Observations(NamedTuple):
    """Inputs of ``DensePolicy``."""

    codes: Tensor
    features: Tensor
    proprio: Tensor

    def rows(self, start: int, stop: int) -> Observations:
        """Some of them."""
        return Observations(*(x[start:stop] for x in self))


@dataclass(frozen=True)
class Parity:
    """How near the file's actions are to the policy's, and how fast both are, one observation at a time."""

    observations_n: int
    largest_difference: float
    """Of any action component."""

    file_ms: float
    """Median time of an action from the file."""

    policy_ms: float
    """Median time of an action from the policy, in the same minute on the same threads."""


def random_observations(env_spec: EnvSpec, n: int, seed: int = 0) -> Observations:
    """Clusters of points in the cube, and the upright tool anywhere in it; one in thirty frames is empty.

    Every observation of a stack is drawn anew.
    """
    rng = np.random.default_rng(seed)
    count = n * env_spec.stack_n
    frames = torch.stack([_random_frame(env_spec.octree, rng) for _ in range(count)])
    proprio = np.stack([_random_proprio(env_spec.octree, rng) for _ in range(count)])
    frames = frames.reshape(n, env_spec.stack_n)
    return Observations(
        frames.codes.contiguous(), frames.features.contiguous(), torch.from_numpy(proprio).view(n, env_spec.stack_n, -1)
    )


@torch.no_grad()
def measure_parity(agent: Agent, run: Runner, observations: Observations) -> Parity:
    """Let the policy and the file act on the same observations, alone and in a batch."""
    act = as_runner(agent)
    n = len(observations.codes)
    differences: list[Tensor] = []
    file_s, policy_s = [], []
    for i in range(n):
        one = observations.rows(i, i + 1)
        expected, seconds = _timed(act, one)
        policy_s.append(seconds)
        action, seconds = _timed(run, one)
        file_s.append(seconds)
        differences.append(action - expected)
    batch = observations.rows(0, min(n, 8))
    differences.append(run(*batch) - act(*batch))
    largest = float(torch.cat(differences).abs().max())
    return Parity(n, largest, 1e3 * median(file_s), 1e3 * median(policy_s))


def as_runner(agent: Agent) -> Runner:
    """The agent's policy, called as a file is."""
    policy = agent.policy

    def act(codes: Tensor, features: Tensor, proprio: Tensor) -> Tensor:
        frames = OctreeFrame(codes=codes, features=features, batch_size=codes.shape[:2])
        return policy(TensorDict({OCTREE: frames, PROPRIO: proprio}, [len(codes)]))[ACTION]

    return act


def _timed(run: Callable[..., Tensor], observation: Observations) -> tuple[Tensor, float]:
    start = time.perf_counter()
    action = run(*observation)
    return action, time.perf_counter() - start


def _random_frame(spec: OctreeSpec, rng: np.random.Generator) -> OctreeFrame:
    if rng.random() < 1 / 30:
        return OctreeFrame.unoccupied(spec)
    n = int(rng.integers(1, MOST_POINTS))
    centres = rng.uniform(size=(MOST_CLUSTERS, 3))
    spreads = rng.uniform(0.01, CLUSTER_SHARE, size=(MOST_CLUSTERS, 1))
    cluster = rng.integers(rng.integers(1, MOST_CLUSTERS + 1), size=n)
    points = centres[cluster] + spreads[cluster] * rng.normal(size=(n, 3))
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    colours = rng.uniform(size=(n, 3)) if spec.colour else None
    return count_octree_from_points(np.array(spec.origin_m) + points * spec.side_m, normals, colours, spec).frame


def _random_proprio(spec: OctreeSpec, rng: np.random.Generator) -> NDArray[np.float32]:
    """Gripper, tcp [m], and the first two columns of ``R_base_tcp`` of a tool that looks down."""
    tcp = np.array(spec.origin_m) + rng.uniform(size=3) * spec.side_m
    yaw = rng.uniform(-np.pi, np.pi)
    x_axis, y_axis = (np.cos(yaw), np.sin(yaw), 0.0), (np.sin(yaw), -np.cos(yaw), 0.0)
    return np.array([rng.uniform(-1, 1), *tcp, *x_axis, *y_axis], np.float32)
