"""The depth camera of Task I: where it stands, what it sees and how its depth errs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from tr_grasp.configs.checks import require, require_range


@dataclass(frozen=True)
class CameraArcCfg:
    """Where the camera stands if ``randomise.camera_pose`` draws it (defaults: the thesis' arc).

    It looks at the workspace's centre from ``distance_m`` away, in a direction of uniform x, y and z that is then
    normalised.
    """

    direction_x: tuple[float, float] = (-1.0, 1.0)
    """Away from the robot (+) or towards it (-), before normalising."""

    direction_y: tuple[float, float] = (-1.0, 1.0)
    """To the robot's left (+) or right (-), before normalising."""

    direction_z: tuple[float, float] = (0.1, 0.7)
    """Upwards, before normalising."""

    distance_m: tuple[float, float] = (1.0, 1.0)
    """From the workspace's centre to the camera."""

    behind_robot_rad: float = math.pi / 8
    """Seen from above, no camera nearer than this to the direction straight behind the robot."""

    def __post_init__(self) -> None:
        require_range("camera.arc.direction_x", self.direction_x)
        require_range("camera.arc.direction_y", self.direction_y)
        require_range("camera.arc.direction_z", self.direction_z, at_least=0.0)
        require_range("camera.arc.distance_m", self.distance_m)
        require(self.distance_m[0] > 0, f"camera.arc.distance_m must be positive, got {self.distance_m}")
        require(
            0 <= self.behind_robot_rad < math.pi,
            f"camera.arc.behind_robot_rad must be in [0, pi), got {self.behind_robot_rad}",
        )
        require(
            any((*self.direction_x, *self.direction_y)),
            "camera.arc must leave the vertical: direction_x or direction_y must differ from (0, 0)",
        )


@dataclass(frozen=True)
class StereoCfg:
    """A stereo depth camera whose errors ``randomise.depth_noise stereo`` gives the picture.

    Defaults: Intel RealSense D415 at 1280 x 720. What the camera sees is taken for a part of this device's picture,
    so the errors do not depend on ``camera.image_size_px``.
    """

    baseline_m: float = 0.055
    """Distance between the two imagers."""

    fov_rad: float = math.radians(65.0)
    """Full horizontal field of view; with the width it gives the focal length."""

    width_px: int = 1280
    """Width of the device's picture."""

    disparity_noise_px: float = 0.08
    """Standard deviation of the matched disparity, in the device's pixels (Intel: 0.08 is best assumed)."""

    noise_radius_px: float = 2.0
    """The matching window correlates errors over about this many of the device's pixels."""

    disparity_step_px: float = 1 / 32
    """Disparity is rounded to multiples of this."""

    range_m: tuple[float, float] = (0.45, 10.0)
    """Depths that can be measured at all."""

    grazing_rad: tuple[float, float] = (math.radians(65.0), math.radians(80.0))
    """Angle between ray and surface normal from which depth begins to fail, and from which it always does."""

    def __post_init__(self) -> None:
        for name in ("baseline_m", "width_px", "disparity_step_px"):
            require(getattr(self, name) > 0, f"camera.stereo.{name} must be positive, got {getattr(self, name)}")
        for name in ("disparity_noise_px", "noise_radius_px"):
            require(getattr(self, name) >= 0, f"camera.stereo.{name} must not be negative, got {getattr(self, name)}")
        require(0 < self.fov_rad < math.pi, f"camera.stereo.fov_rad must be in (0, pi), got {self.fov_rad}")
        require_range("camera.stereo.range_m", self.range_m, at_least=0.0)
        require_range("camera.stereo.grazing_rad", self.grazing_rad, at_least=0.0)


@dataclass(frozen=True)
class CameraCfg:
    """The depth camera."""

    backend: Literal["raycast", "sapien"] = "raycast"
    """``raycast`` needs no graphics driver; ``sapien`` renders with Vulkan."""

    eye_m: tuple[float, float, float] = (1.0, -0.35, 0.60)
    """Position of the camera in the base frame, unless ``randomise.camera_pose`` draws it."""

    target_m: tuple[float, float, float] = (0.5, 0.0, 0.06)
    """Point that the camera looks at, in the base frame, unless ``randomise.camera_pose`` draws it."""

    fov_rad: float = 0.47
    """Full vertical field of view."""

    image_size_px: int = 80
    """Width and height of the square depth image."""

    depth_noise_m: float = 0.001
    """Standard deviation of the Gaussian depth noise."""

    arc: CameraArcCfg = field(default_factory=CameraArcCfg)
    """Where a drawn camera stands."""

    stereo: StereoCfg = field(default_factory=StereoCfg)
    """The device whose errors stereo noise imitates."""

    def __post_init__(self) -> None:
        require(8 <= self.image_size_px <= 1024, f"camera.image_size_px must be 8..1024, got {self.image_size_px}")
        require(0 < self.fov_rad < 2.5, f"camera.fov_rad must be in (0, 2.5), got {self.fov_rad}")
        require(self.depth_noise_m >= 0, f"camera.depth_noise_m must not be negative, got {self.depth_noise_m}")
