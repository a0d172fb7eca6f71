"""Which objects a scene of Task I has."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from tr_grasp.configs import ObjectsCfg
from tr_grasp.objects import ObjectModel, ObjectSet, ProceduralSet, object_set
from tr_grasp.objects.families import WIDE
from tr_grasp.objects.splits import Overlap


def draw_models(cfg: ObjectsCfg, rng: np.random.Generator, *, count_is_drawn: bool = True) -> list[ObjectModel]:
    """The objects of a scene.

    Args:
        cfg: What to draw from.
        rng: The scene's stream.
        count_is_drawn: Draw how many there are; otherwise as many as may be.

    Raises:
        ConfigError: There are no such objects.
        MeshError: An object of a folder cannot be simulated.
    """
    # Without such scenes nothing is drawn for them, so that scenes do not depend on whether the setting exists.
    if cfg.lone_wide_share and rng.random() < cfg.lone_wide_share:
        return [ProceduralSet(cfg.split, list(WIDE)).sample(rng)]
    chosen = _objects(cfg.source, cfg.split, cfg.diagonal_range_m, cfg.overlap)
    count = int(rng.integers(cfg.count_range[0], cfg.count_range[1] + 1))
    return [chosen.sample(rng) for _ in range(count if count_is_drawn else cfg.count_range[1])]


@lru_cache(maxsize=8)
def _objects(source: str, split: str, diagonal_range_m: tuple[float, float], overlap: Overlap) -> ObjectSet:
    return object_set(source, split, diagonal_range_m=diagonal_range_m, overlap=overlap)
