"""Depth as a stereo camera measures it: the errors of an Intel RealSense D415.

Stereo measures disparity, so its errors are made there: ``disparity = focal_px * baseline_m / depth``. Noise of a
constant part of a pixel thus becomes ``depth^2 / (focal_px * baseline_m)`` times that in depth.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import convolve1d
from scipy.special import ndtri

from tr_grasp.configs import StereoCfg
from tr_grasp.sensing.camera import DepthImage, PinholeCamera

Array = NDArray[np.floating]

D415 = StereoCfg()
"""Intel RealSense D415 at 1280 x 720."""


def with_stereo_errors(
    image: DepthImage, camera: PinholeCamera, rng: np.random.Generator, device: StereoCfg = D415
) -> DepthImage:
    """Measure the depth of a noise-free picture with a stereo device; ``inf`` is where it measures none.

    There is none out of range, where the ray grazes the surface, where the second imager, to the right of the first,
    does not see what the first sees, and where nothing is.

    Args:
        image: A noise-free picture.
        camera: What took it: a part of the device's field of view, coarser or finer.
        rng: What is random.
        device: The device.
    """
    with np.errstate(divide="ignore"):
        inverse = np.float32(1.0) / image.depth
    measured = _measured_inverse(inverse, camera, rng, device)
    chance = _grazing(incidence_rad(inverse, camera), device.grazing_rad)
    grazed = _smooth_noise(inverse.shape, _window_px(camera, device), rng) < ndtri(chance)
    near, far = device.range_m
    lost = (measured < 1.0 / far) | (measured * near > 1.0) | grazed
    lost |= in_shadow(inverse, camera, device)
    nothing = np.full_like(image.depth, np.inf)
    return replace(image, depth=np.divide(np.float32(1.0), measured, out=nothing, where=~lost))


def focal_px(device: StereoCfg) -> float:
    """Focal length in the device's pixels."""
    return device.width_px / 2 / float(np.tan(device.fov_rad / 2))


def depth_error_m(depth_m: Array | float, device: StereoCfg = D415) -> Array | float:
    """Standard deviation of the depth of a plane that faces the device.

    Source: Intel, tuning guide of the D400 series: ``depth^2 * subpixel / (focal length * baseline)``; here with the
    error of rounding, which is uniform over a step.
    """
    error_px = np.hypot(device.disparity_noise_px, device.disparity_step_px / np.sqrt(12.0))
    return depth_m * depth_m * error_px / (focal_px(device) * device.baseline_m)


def incidence_rad(inverse_depth: Array, camera: PinholeCamera) -> Array:
    """(h, w) angle between each ray and the normal of the surface that it meets.

    The inverse depth of a plane is linear in the picture, and its slopes there are the plane's normal. Of the
    differences to both neighbours the smaller counts, so that a silhouette does not look like a slope.

    Args:
        inverse_depth: (h, w) [1/m], 0 where nothing is.
        camera: What took the picture.
    """
    rays = camera.directions_cam.astype(inverse_depth.dtype)
    x, y = rays[0, :, 0], rays[:, :1, 1]
    slope_x = camera.focal_px * _smaller_step(inverse_depth.T).T
    slope_y = camera.focal_px * _smaller_step(inverse_depth)
    along = inverse_depth - x * slope_x - y * slope_y
    squared = (slope_x * slope_x + slope_y * slope_y + along * along) * (x * x + y * y + 1.0)
    return np.arccos(np.clip(inverse_depth / np.sqrt(np.maximum(squared, 1e-12)), 0.0, 1.0))


def in_shadow(inverse_depth: Array, camera: PinholeCamera, device: StereoCfg = D415) -> NDArray[np.bool_]:
    """(h, w) pixels that something nearer, to their right, hides from the second imager."""
    columns = np.arange(camera.width_px, dtype=inverse_depth.dtype)
    columns = columns - camera.focal_px * device.baseline_m * inverse_depth
    leftmost = np.minimum.accumulate(columns[:, :0:-1], axis=1)[:, ::-1]
    return np.pad(leftmost < columns[:, :-1], ((0, 0), (0, 1)))


def _measured_inverse(inverse: Array, camera: PinholeCamera, rng: np.random.Generator, device: StereoCfg) -> Array:
    """(h, w) inverse depth [1/m] from noisy, rounded disparities."""
    scale_px = focal_px(device) * device.baseline_m
    noise = _smooth_noise(inverse.shape, _window_px(camera, device), rng)
    disparity = scale_px * inverse + device.disparity_noise_px * noise
    return np.round(disparity / device.disparity_step_px) * (device.disparity_step_px / scale_px)


def _window_px(camera: PinholeCamera, device: StereoCfg) -> float:
    """Radius in the camera's pixels over which the device errs alike, for it compares windows and not points."""
    return device.noise_radius_px * camera.focal_px / focal_px(device)


def _smooth_noise(shape: tuple[int, ...], radius_px: float, rng: np.random.Generator) -> Array:
    """Standard normal numbers (h, w), correlated over about ``radius_px`` pixels."""
    noise = rng.standard_normal(shape, np.float32)
    reach = int(np.ceil(3 * radius_px))
    if radius_px < 0.5 or reach >= min(shape):
        return noise
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / radius_px) ** 2)
    weights /= np.linalg.norm(weights)
    for axis in (0, 1):
        noise = convolve1d(noise, weights, axis=axis, mode="wrap")  # wrapping keeps the variance at the border
    return noise


def _smaller_step(values: Array) -> Array:
    """Down the columns, of the differences to the neighbours before and after, the one nearer to zero."""
    steps = np.empty((len(values) + 1, *values.shape[1:]), values.dtype)
    np.subtract(values[1:], values[:-1], out=steps[1:-1])
    steps[0], steps[-1] = steps[1], steps[-2]
    return np.where(np.abs(steps[:-1]) < np.abs(steps[1:]), steps[:-1], steps[1:])


def _grazing(angle_rad: Array, ramp_rad: tuple[float, float]) -> Array:
    """Probability that an incidence is too flat: 0 below the ramp, 1 above."""
    low, high = ramp_rad
    return np.clip((angle_rad - low) / max(high - low, 1e-9), 0.0, 1.0)
