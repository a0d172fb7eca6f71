"""Trials of pick and place with the object not quite where it was taught, judged by the simulator."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from tr_grasp.envs.pick_place_world import judge, look_camera, pick_place_world
from tr_grasp.pick_place import BlindPickPlace, GraspChoice, Perception, StationCfg

SETTLE_S = 0.3
AFTER_S = 0.7


@dataclass(frozen=True)
class PickPlaceTrial:
    """One trial.

    Attributes:
        seed: Of the perturbation.
        shift_m: (2,) how far the object was from where the task expects it.
        yaw_rad: How the object was turned.
        outcome: Name of the task's own outcome.
        reason: The same in words.
        placed: The simulator found the object at its goal.
        upright: There it stands.
        touches_n: Links that touched what must not be touched.
        force_n: The greatest force of these touches.
        cycle_s: Simulated time from the first stage to the end of the last.
        retries_n: Grips that were tried again.
    """

    seed: int
    shift_m: tuple[float, float]
    yaw_rad: float
    outcome: str
    reason: str
    placed: bool
    upright: bool
    touches_n: int
    force_n: float
    cycle_s: float
    retries_n: int

    @property
    def succeeded(self) -> bool:
        """Placed, and nothing was touched that must not be."""
        return self.placed and not self.touches_n


def pick_place_trials(
    cfg: StationCfg,
    seeds: Iterable[int],
    *,
    shift_m: float = 0.01,
    retries_n: int = 2,
    physics_hz: int = 120,
    grasp: GraspChoice | None = None,
) -> Iterator[PickPlaceTrial]:
    """Trials one after the other; each depends on its seed alone.

    Args:
        cfg: The station.
        seeds: One for each trial.
        shift_m: Largest shift of the object along x and y; uniform. Its yaw is any.
        retries_n: As for :meth:`BlindPickPlace.run`.
        physics_hz: Steps per second.
        grasp: How a camera finds the object; blind, if not given.
    """
    camera = look_camera(cfg) if grasp is not None else None
    for number in seeds:
        rng = np.random.default_rng(number)
        dx, dy = (float(d) for d in rng.uniform(-shift_m, shift_m, 2))
        yaw = float(rng.uniform(-np.pi, np.pi))
        x, y, _ = cfg.object.foot_m
        devices = pick_place_world(cfg, foot_m=(x + dx, y + dy), yaw_rad=yaw, camera=camera, physics_hz=physics_hz)
        devices.world.wait(SETTLE_S)
        devices.world.forget_touches()
        locate = None
        if camera is not None and grasp is not None:
            locate = Perception(cfg, devices, camera.T_base_cam, grasp)
        result = BlindPickPlace(cfg, devices, locate=locate).run(retries_n)
        devices.world.wait(AFTER_S)
        verdict = judge(devices, cfg)
        yield PickPlaceTrial(
            seed=number,
            shift_m=(dx, dy),
            yaw_rad=yaw,
            outcome=result.outcome.name,
            reason=result.reason,
            placed=verdict.placed,
            upright=verdict.upright,
            touches_n=len(verdict.touches),
            force_n=max((touch.force_n for touch in verdict.touches), default=0.0),
            cycle_s=result.cycle_s,
            retries_n=len(result.retries),
        )
