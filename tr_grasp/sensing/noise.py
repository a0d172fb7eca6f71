"""Errors of a depth sensor."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from tr_grasp.configs import CameraCfg
from tr_grasp.sensing.camera import DepthImage, PinholeCamera
from tr_grasp.sensing.stereo import with_stereo_errors

DepthNoise = Literal["none", "gaussian", "stereo"]


def with_depth_noise(
    kind: DepthNoise, image: DepthImage, camera: PinholeCamera, cfg: CameraCfg, rng: np.random.Generator
) -> DepthImage:
    """The picture with the errors of one kind.

    Args:
        kind: Which; ``none`` leaves the picture alone.
        image: A noise-free picture.
        camera: What took it.
        cfg: How large the errors are.
        rng: What is random.
    """
    if kind == "stereo":
        return with_stereo_errors(image, camera, rng, cfg.stereo)
    return with_gaussian_depth_noise(image, cfg.depth_noise_m if kind == "gaussian" else 0.0, rng)


def with_gaussian_depth_noise(image: DepthImage, sigma_m: float, rng: np.random.Generator) -> DepthImage:
    """Add independent Gaussian noise of standard deviation ``sigma_m`` to every depth."""
    if sigma_m == 0:
        return image
    noise = rng.standard_normal(image.depth.shape, dtype=np.float32)
    return replace(image, depth=image.depth + np.float32(sigma_m) * noise)
