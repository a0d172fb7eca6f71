"""Motions at random, with the ranges of the benchmark."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Generator, Tensor

from tr_grasp.errors import PredictionError, unknown_name
from tr_grasp.prediction.motions.bezier import bezier
from tr_grasp.prediction.motions.curves import circular, sinusoidal, two_tone
from tr_grasp.prediction.motions.lines import linear, linear_z, rotating, varying_speed
from tr_grasp.prediction.motions.state import TargetState, Value, number
from tr_grasp.prediction.motions.turns import random_turns

Parameters = dict[str, Tensor]
Range = tuple[float, float]

MOTIONS: dict[str, Callable[..., TargetState]] = {
    "linear": linear,
    "circular": circular,
    "sinusoidal": sinusoidal,
    "linear_z": linear_z,
    "varying_speed": varying_speed,
    "rotating": rotating,
    "bezier": bezier,
    "random_turns": random_turns,
    "two_tone": two_tone,
}
"""Every kind of motion."""

_PIECES_N = 6
_MOST_TRIES = 10_000


@dataclass(frozen=True)
class MotionCfg:
    """Ranges from which motions are drawn, evenly; those of the benchmark by default."""

    distance_m: Range = (0.3, 0.7)
    """From the base to the middle of the path, and the radius of the circle."""
    theta_deg: Range = (-90.0, 90.0)
    """Direction of the middle of the path, seen from the base; circles start anywhere."""
    length_m: float = 1.0
    """Length of the path (of the line that carries the sine)."""
    z_m: float = 0.02
    """Height of paths that stay level."""
    climb_z_m: Range = (0.01, 0.30)
    """Heights between which ``linear_z`` goes."""
    amplitude_m: Range = (0.125, 0.125)
    """Of the sine."""
    amplitude_share: float | None = None
    """The amplitude as a share of the distance instead; the thesis' networks learn with 0.5."""
    wavelength_m: Range = (1 / 3, 1 / 3)
    """Of the sine."""
    yaw_rate_rad_s: Range = (0.1, 0.5)
    """Of ``rotating``, to either side."""
    bend_m: Range = (0.1, 0.4)
    """How far the inner control points of ``bezier`` lie beside the line, to either side each."""
    turn_radius_m: Range = (0.08, 0.25)
    """Of the turns in ``random_turns``."""
    turn_deg: Range = (30.0, 120.0)
    """How far those turn, to either side."""
    annulus_m: Range = (0.25, 0.85)
    """Where ``bezier`` and ``random_turns`` stay, seen from the base."""


@dataclass(frozen=True)
class Motion:
    """A batch of motions of one kind."""

    kind: str
    parameters: Mapping[str, Tensor]
    """Arguments of that function in :data:`MOTIONS`, each (n, ...)."""

    def at(self, t: Value) -> TargetState:
        """Where all n targets are at time ``t`` [s]: one number, or (*times, 1), or (*times, n)."""
        return MOTIONS[self.kind](t, **self.parameters)

    @property
    def duration_s(self) -> Tensor:
        """(n,) Time from start to stop."""
        return self.at(0.0).remaining_s

    def __len__(self) -> int:
        return len(self.parameters["speed_m_s"])

    def __getitem__(self, index: int) -> Motion:
        """One of them, as a batch of one."""
        chosen = range(len(self))[index]
        return Motion(self.kind, {name: value[chosen : chosen + 1] for name, value in self.parameters.items()})


def sample_motion(kind: str, n: int, *, speed_m_s: Value, generator: Generator, cfg: MotionCfg | None = None) -> Motion:
    """``n`` motions of one kind.

    Args:
        kind: A name in :data:`MOTIONS`.
        n: How many.
        speed_m_s: One speed, or one for each (n,).
        generator: Decides everything that is random; equal seeds give equal motions.
        cfg: Ranges.

    Raises:
        PredictionError: No such kind, a speed that is not positive, or ranges in which no path fits.
    """
    if kind not in MOTIONS:
        raise PredictionError(unknown_name("motion", kind, MOTIONS))
    draw = _Draw(n, generator, cfg or MotionCfg())
    parameters = _SAMPLERS[kind](draw)
    motion = Motion(kind, {"speed_m_s": number(speed_m_s).expand(n), **parameters})
    motion.at(0.0)  # refuses a speed that is not positive
    return motion


@dataclass(frozen=True)
class _Draw:
    """Random numbers for n motions."""

    n: int
    generator: Generator
    cfg: MotionCfg

    def uniform(self, bounds: Range, *more: int) -> Tensor:
        low, high = bounds
        return low + (high - low) * torch.rand(self.n, *more, generator=self.generator, dtype=torch.float64)

    def sign(self, *more: int) -> Tensor:
        return 2.0 * torch.randint(2, (self.n, *more), generator=self.generator) - 1.0

    def angle(self) -> Tensor:
        return self.uniform((-math.pi, math.pi))

    def theta(self) -> Tensor:
        return self.uniform(self.cfg.theta_deg).deg2rad()

    def same(self, value: float) -> Tensor:
        return torch.full((self.n,), value, dtype=torch.float64)


def _placed(draw: _Draw) -> Parameters:
    return {
        "distance_m": draw.uniform(draw.cfg.distance_m),
        "theta_rad": draw.theta(),
        "direction": draw.sign(),
        "yaw_rad": draw.angle(),
        "length_m": draw.same(draw.cfg.length_m),
    }


def _level(draw: _Draw) -> Parameters:
    return {**_placed(draw), "z_m": draw.same(draw.cfg.z_m)}


def _circular(draw: _Draw) -> Parameters:
    return {**_level(draw), "theta_rad": draw.uniform((0.0, 2 * math.pi))}


def _sinusoidal(draw: _Draw) -> Parameters:
    parameters, share = _level(draw), draw.cfg.amplitude_share
    amplitude = draw.uniform(draw.cfg.amplitude_m) if share is None else share * parameters["distance_m"]
    return {**parameters, "amplitude_m": amplitude, "wavelength_m": draw.uniform(draw.cfg.wavelength_m)}


def _two_tone(draw: _Draw) -> Parameters:
    return {
        **_level(draw),
        "wavelength_m": draw.uniform((0.4, 0.6)),
        "phase_rad": draw.angle(),
        "second_wavelength_m": draw.uniform((0.15, 0.25)),
        "second_phase_rad": draw.angle(),
    }


def _linear_z(draw: _Draw) -> Parameters:
    heights = draw.cfg.climb_z_m
    return {**_placed(draw), "z_start_m": draw.uniform(heights), "z_end_m": draw.uniform(heights)}


def _rotating(draw: _Draw) -> Parameters:
    return {**_level(draw), "yaw_rate_rad_s": draw.sign() * draw.uniform(draw.cfg.yaw_rate_rad_s)}


def _bezier(draw: _Draw) -> Parameters:
    cfg = draw.cfg

    def paths(draw: _Draw) -> Parameters:
        along = torch.tensor([-0.5, -1 / 6, 1 / 6, 0.5], dtype=torch.float64) * cfg.length_m
        beside = torch.zeros(draw.n, 4, dtype=torch.float64)
        beside[:, 1:3] = draw.sign(2) * draw.uniform(cfg.bend_m, 2)
        radial = draw.uniform(cfg.distance_m).unsqueeze(-1) + beside
        tangential = draw.sign().unsqueeze(-1) * along
        theta = draw.theta().unsqueeze(-1)
        cosine, sine = theta.cos(), theta.sin()
        x, y = cosine * radial - sine * tangential, sine * radial + cosine * tangential
        points = torch.stack([x, y, torch.full_like(x, cfg.z_m)], -1)
        return {"control_points_m": points, "yaw_rad": draw.angle()}

    return _kept_near(draw, "bezier", paths)


def _random_turns(draw: _Draw) -> Parameters:
    cfg = draw.cfg

    def paths(draw: _Draw) -> Parameters:
        turns = draw.uniform(cfg.turn_deg, _PIECES_N).deg2rad()
        radii = draw.uniform(cfg.turn_radius_m, _PIECES_N)
        curvatures = draw.sign(_PIECES_N) / radii
        lengths = turns * radii
        # Straight pieces between the turns, of random lengths that fill up what is left.
        curvatures[:, ::2], lengths[:, ::2] = 0.0, draw.uniform((0.1, 0.4), _PIECES_N)[:, ::2]
        lengths = lengths / lengths.sum(-1, keepdim=True) * cfg.length_m
        radius, theta = draw.uniform(cfg.distance_m), draw.theta()
        start = torch.stack([radius * theta.cos(), radius * theta.sin(), draw.same(cfg.z_m)], -1)
        return {
            "start_m": start,
            "heading_rad": draw.angle(),
            "lengths_m": lengths,
            "curvatures_1_m": curvatures,
            "yaw_rad": draw.angle(),
        }

    return _kept_near(draw, "random_turns", paths)


def _kept_near(draw: _Draw, kind: str, paths: Callable[[_Draw], Parameters]) -> Parameters:
    """Draw again those paths that leave the annulus, until none is left."""
    nearest, farthest = draw.cfg.annulus_m
    kept: list[Parameters] = []
    while sum(len(found["yaw_rad"]) for found in kept) < draw.n:
        tried = paths(draw)
        motion = Motion(kind, {"speed_m_s": draw.same(1.0), **tried})
        times = torch.linspace(0, 1, 65, dtype=torch.float64).unsqueeze(-1) * motion.duration_s
        reach = motion.at(times).position[..., :2].norm(dim=-1)
        stays = ((reach >= nearest) & (reach <= farthest)).all(0)
        kept.append({name: value[stays] for name, value in tried.items()})
        if len(kept) > _MOST_TRIES:
            raise PredictionError(f"no path of kind {kind!r} fits between {nearest} and {farthest} m from the base.")
    return {name: torch.cat([found[name] for found in kept])[: draw.n] for name in kept[0]}


_SAMPLERS: dict[str, Callable[[_Draw], Parameters]] = {
    "linear": _level,
    "circular": _circular,
    "sinusoidal": _sinusoidal,
    "linear_z": _linear_z,
    "varying_speed": _level,
    "rotating": _rotating,
    "bezier": _bezier,
    "random_turns": _random_turns,
    "two_tone": _two_tone,
}
