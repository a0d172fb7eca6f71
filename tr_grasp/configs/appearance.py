"""How differently scenes may look."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from tr_grasp.configs.checks import require, require_range


@dataclass(frozen=True)
class AppearanceCfg:
    """Ranges of the randomisers of ``randomise`` that change colours and nothing else."""

    texture_split: Literal["objects", "train", "test"] = "objects"
    """Whose ground textures: those of the same split as the objects, or of a fixed one. Splits share no family of
    patterns, no hue and no number of cells."""

    texture_side_m: tuple[float, float] = (0.3, 0.8)
    """Edge of the square that a ground texture repeats, if ``randomise.ground_texture`` draws one."""

    texture_yaw_rad: tuple[float, float] = (0.0, 2 * math.pi)
    """Turn of a ground texture about the vertical."""

    table_hue: tuple[float, float] = (0.0, 1.0)
    """Hue of the table, 0 and 1 are red, if ``randomise.table_colour`` draws it; under a texture, the colour that it
    has on average."""

    table_saturation: tuple[float, float] = (0.0, 0.4)
    """Saturation of the table, 0 is grey."""

    table_value: tuple[float, float] = (0.25, 0.85)
    """Lightness of the table, 0 is black."""

    object_hue_shift: tuple[float, float] = (-0.5, 0.5)
    """How far ``randomise.object_tint`` moves the hues of an object round the colour circle, which is 1 long."""

    object_value_factor: tuple[float, float] = (0.6, 1.3)
    """Factor on the lightness of an object."""

    light_elevation_rad: tuple[float, float] = (0.6, 1.5)
    """Height of the sun above the horizon if ``randomise.light`` draws one; it may stand in any direction."""

    light_sun: tuple[float, float] = (0.3, 0.8)
    """Brightness that the sun adds to surfaces that face it."""

    light_ambient: tuple[float, float] = (0.3, 0.6)
    """Brightness of surfaces that the sun does not reach."""

    def __post_init__(self) -> None:
        for name in ("texture_yaw_rad", "object_hue_shift"):
            require_range(f"appearance.{name}", getattr(self, name))
        for name in ("object_value_factor", "light_sun", "light_ambient"):
            require_range(f"appearance.{name}", getattr(self, name), at_least=0.0)
        require_range("appearance.texture_side_m", self.texture_side_m, at_least=0.05)
        for name, most in (
            ("table_hue", 1.0),
            ("table_saturation", 1.0),
            ("table_value", 1.0),
            ("light_elevation_rad", math.pi / 2),
        ):
            low, high = getattr(self, name)
            require(
                0 <= low <= high <= most, f"appearance.{name} must be 0 <= low <= high <= {most:.4g}, got {(low, high)}"
            )
