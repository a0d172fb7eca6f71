"""How an episode looks: drawn from streams of its own, so that it changes nothing that is not a colour."""

from __future__ import annotations

import colorsys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from matplotlib.colors import hsv_to_rgb, rgb_to_hsv
from numpy.typing import NDArray

from tr_grasp.configs import AppearanceCfg, EnvCfg
from tr_grasp.envs.streams import Stream, stream
from tr_grasp.objects import ObjectModel
from tr_grasp.sensing.look import GroundTexture, Light, Look
from tr_grasp.sensing.textures import Split, draw_recipe, texture_image


def draw_look(cfg: EnvCfg, episode_seed: int) -> Look:
    """Ground and light of an episode; what is not randomised stays plain."""
    switches, ranges = cfg.randomise, cfg.appearance
    ground = None
    if switches.ground_texture:
        split = cfg.objects.split if ranges.texture_split == "objects" else ranges.texture_split
        ground = draw_ground(split, ranges, stream(episode_seed, Stream.GROUND_TEXTURE))
    if switches.table_colour:
        ground = _coloured(ground, _table_colour(ranges, stream(episode_seed, Stream.TABLE_COLOUR)))
    light = draw_light(ranges, stream(episode_seed, Stream.LIGHT)) if switches.light else None
    return Look(ground, light)


def draw_ground(split: Split, ranges: AppearanceCfg, rng: np.random.Generator) -> GroundTexture:
    """A procedural texture of a split, and how it lies."""
    side_m, yaw_rad = rng.uniform(*ranges.texture_side_m), rng.uniform(*ranges.texture_yaw_rad)
    return GroundTexture(texture_image(draw_recipe(split, rng)), float(side_m), float(yaw_rad))


def draw_light(ranges: AppearanceCfg, rng: np.random.Generator) -> Light:
    """Direction and strength of a sun."""
    azimuth, elevation = rng.uniform(0, 2 * np.pi), rng.uniform(*ranges.light_elevation_rad)
    to_sun = np.array([*(np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])), np.sin(elevation)])
    return Light(to_sun, float(rng.uniform(*ranges.light_sun)), float(rng.uniform(*ranges.light_ambient)))


def tinted_models(cfg: EnvCfg, episode_seed: int, models: Sequence[ObjectModel]) -> list[ObjectModel]:
    """Objects in other colours, drawn with the scene; the same ones while ``randomise.object_tint`` is off."""
    if not cfg.randomise.object_tint:
        return list(models)
    rng = stream(episode_seed, Stream.OBJECT_TINT)
    return [replace(model, face_colours=_tinted(model.face_colours, cfg.appearance, rng)) for model in models]


def _tinted(colours: NDArray[np.float32], ranges: AppearanceCfg, rng: np.random.Generator) -> NDArray[np.float32]:
    hsv = rgb_to_hsv(colours)
    hsv[:, 0] = (hsv[:, 0] + rng.uniform(*ranges.object_hue_shift)) % 1.0
    hsv[:, 2] = np.clip(hsv[:, 2] * rng.uniform(*ranges.object_value_factor), 0, 1)
    return hsv_to_rgb(hsv).astype(np.float32)


def _table_colour(ranges: AppearanceCfg, rng: np.random.Generator) -> tuple[float, float, float]:
    hue, saturation, value = (
        float(rng.uniform(*range_)) for range_ in (ranges.table_hue, ranges.table_saturation, ranges.table_value)
    )
    return colorsys.hsv_to_rgb(hue, saturation, value)


def _coloured(ground: GroundTexture | None, colour: tuple[float, float, float]) -> GroundTexture:
    """Plain ground of a colour, or a texture that has it on average, as far as no channel saturates."""
    if ground is None:
        return GroundTexture.uniform(colour)
    factor = np.asarray(colour, np.float32) / np.maximum(ground.image.mean(axis=(0, 1)), 1e-3)
    return replace(ground, image=np.clip(ground.image * factor, 0, 1))
