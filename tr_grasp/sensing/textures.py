"""Procedural textures for the ground: families of patterns, of which training and test have none in common."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.sensing import patterns
from tr_grasp.sensing.patterns import Pattern

Split = Literal["train", "test"]
SIZE_PX = 256
SHADES = 513
"""Mixtures of a palette's colours."""
HUE_SECTORS = 12
"""The colour circle has so many; training has the even ones, test the odd ones."""

FAMILIES: dict[Split, dict[str, Pattern]] = {
    "train": {
        "checks": patterns.checks,
        "clouds": patterns.clouds,
        "speckle": patterns.speckle,
        "stripes": patterns.stripes,
        "tiles": patterns.tiles,
        "wood": patterns.wood,
    },
    "test": {
        "bricks": patterns.bricks,
        "dots": patterns.dots,
        "marble": patterns.marble,
        "weave": patterns.weave,
    },
}
"""Patterns of each split, by name."""

CELLS: dict[Split, tuple[int, ...]] = {"train": (4, 6, 8, 10), "test": (5, 7, 9)}
"""Repetitions of a pattern along an edge of its square."""


@dataclass(frozen=True)
class TextureRecipe:
    """All that makes a texture; equal recipes make equal pictures.

    Attributes:
        split: Whose it is.
        family: Name of the pattern.
        cells: Repetitions along an edge.
        palette: Three colours, red, green and blue in [0, 1] each.
        seed: Of the pattern's own random numbers.
    """

    split: Split
    family: str
    cells: int
    palette: tuple[tuple[float, float, float], ...]
    seed: int


def draw_recipe(split: Split, rng: np.random.Generator, family: str | None = None) -> TextureRecipe:
    """A random texture.

    Training and test differ in their families, in the number of cells and in the hues.

    Args:
        split: ``train`` or ``test``.
        rng: Source of everything random.
        family: One family of the split; any by default.

    Raises:
        ConfigError: No such split, or no such family in it.
    """
    if split not in FAMILIES:
        raise ConfigError(unknown_name("texture split", split, FAMILIES))
    if family is not None and family not in FAMILIES[split]:
        raise ConfigError(unknown_name(f"texture of the {split} split", family, FAMILIES[split]))
    drawn = str(rng.choice(list(FAMILIES[split])))
    family = drawn if family is None else family
    return TextureRecipe(
        split=split,
        family=family,
        cells=int(rng.choice(CELLS[split])),
        palette=_wooden_palette(rng) if family == "wood" else _palette(split, rng),
        seed=int(rng.integers(2**31)),
    )


def texture_image(recipe: TextureRecipe, size_px: int = SIZE_PX) -> NDArray[np.float32]:
    """(size, size, 3) colours in [0, 1] that continue over every edge at the opposite one."""
    rng = np.random.default_rng(recipe.seed)
    field = FAMILIES[recipe.split][recipe.family](size_px, recipe.cells, rng)
    palette = np.asarray(recipe.palette, np.float32)
    shades = np.stack([np.interp(np.linspace(0, 2, SHADES), [0, 1, 2], column) for column in palette.T], axis=1)
    colour = shades.astype(np.float32)[(field * (SHADES - 1) / 2).clip(0, SHADES - 1).astype(np.intp)]
    grain = 1 + 0.08 * (patterns.noise(size_px, (64, 64), rng).astype(np.float32) - 0.5)
    # Whole steps of 8 bits, so that a graphics driver is given exactly the same.
    return (np.round(255 * np.clip(colour * grain[..., None], 0, 1)) / 255).astype(np.float32)


def hue_sector(colour: tuple[float, float, float]) -> int:
    """Which of the ``HUE_SECTORS`` a colour belongs to."""
    return int(colorsys.rgb_to_hsv(*colour)[0] * HUE_SECTORS) % HUE_SECTORS


def _palette(split: Split, rng: np.random.Generator) -> tuple[tuple[float, float, float], ...]:
    """Two related colours and a third that stands out against both."""
    value = rng.uniform(0.35, 0.9)
    contrast = rng.uniform(0.15, 0.4) * (-1 if value > 0.6 else 1)
    values = (value, value + contrast, value - 0.6 * contrast)
    saturation = rng.uniform(0.08, 0.6)
    return tuple(colorsys.hsv_to_rgb(_hue(split, rng), saturation, float(np.clip(v, 0.05, 0.97))) for v in values)


def _wooden_palette(rng: np.random.Generator) -> tuple[tuple[float, float, float], ...]:
    """Two browns of the first sector, and a dark one for the gaps."""
    hue, saturation, value = rng.uniform(0.5, 0.95) / HUE_SECTORS, rng.uniform(0.3, 0.6), rng.uniform(0.5, 0.9)
    return tuple(colorsys.hsv_to_rgb(hue, saturation, share * value) for share in (1.0, rng.uniform(0.55, 0.8), 0.3))


def _hue(split: Split, rng: np.random.Generator) -> float:
    """A hue in [0, 1) from the sectors of a split; a little inside them, so that 8 bits keep it there."""
    sector = 2 * rng.integers(HUE_SECTORS // 2) + (split == "test")
    return float((sector + rng.uniform(0.05, 0.95)) / HUE_SECTORS)
