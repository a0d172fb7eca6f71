"""Errors of a depth sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tr_grasp.sensing.camera import DepthImage


def with_gaussian_depth_noise(image: DepthImage, sigma_m: float, rng: np.random.Generator) -> DepthImage:
    """Add independent Gaussian noise of standard deviation ``sigma_m`` to every depth."""
    if sigma_m == 0:
        return image
    noise = rng.standard_normal(image.depth.shape, dtype=np.float32)
    return replace(image, depth=image.depth + np.float32(sigma_m) * noise)
