"""Intel RealSense (D415 and its kin) through ``pyrealsense2``: colour, and depth aligned to it."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import Any

import numpy as np

from tr_grasp.errors import ConfigError, HardwareError
from tr_grasp.hardware.adapters.extras import maker_package
from tr_grasp.hardware.adapters.remote_clock import RemoteClock
from tr_grasp.hardware.readings import Intrinsics, RGBDImage
from tr_grasp.hardware.real_world import Beats

STALE_S = 0.5
"""A picture that is older is none."""


@dataclass(frozen=True)
class RealSenseCfg:
    """Settings of a RealSense.

    Raises:
        ConfigError: A size, rate or distance that is not positive.
    """

    serial: str = ""
    """Of the camera; any, if empty."""
    width_px: int = 640
    """Of both streams."""
    height_px: int = 480
    """Of both streams."""
    rate_hz: int = 30
    """Pictures a second."""
    frame: str = "camera_color_optical_frame"
    """Name of its optical frame."""
    furthest_m: float = 3.0
    """Depth beyond this is not reported."""
    timeout_s: float = 5.0
    """For the first picture."""

    def __post_init__(self) -> None:
        for name in ("width_px", "height_px", "rate_hz", "furthest_m", "timeout_s"):
            if getattr(self, name) <= 0:
                raise ConfigError(f"realsense.{name} must be positive, got {getattr(self, name)}.")


class RealSense:
    """A camera that streams in a thread of its own.

    Args:
        cfg: Settings.
        clock: Ours.
        rs: The module ``pyrealsense2``, or one that does the same.

    Raises:
        HardwareError: pyrealsense2 is missing, or there is no camera, or no picture comes.
    """

    def __init__(self, cfg: RealSenseCfg, clock: Beats, rs: Any = None) -> None:
        self.frame, self._cfg, self._clock = cfg.frame, cfg, clock
        self._rs = rs or maker_package("pyrealsense2", "realsense", "the camera 'realsense'")
        self._pipeline, self._remote = self._rs.pipeline(), RemoteClock()
        self._newest: RGBDImage | None = None
        self._lock, self._trouble = threading.Lock(), ""
        wanted = self._rs.config()
        if cfg.serial:
            wanted.enable_device(cfg.serial)
        stream, kind = self._rs.stream, self._rs.format
        wanted.enable_stream(stream.color, cfg.width_px, cfg.height_px, kind.rgb8, cfg.rate_hz)
        wanted.enable_stream(stream.depth, cfg.width_px, cfg.height_px, kind.z16, cfg.rate_hz)
        try:
            profile = self._pipeline.start(wanted)
            self._metres = float(profile.get_device().first_depth_sensor().get_depth_scale())
            self._align = self._rs.align(stream.color)
            frames = self._pipeline.wait_for_frames(int(1e3 * cfg.timeout_s))
        except RuntimeError as error:
            which = f"RealSense {cfg.serial}" if cfg.serial else "RealSense"
            raise HardwareError(f"no {which} camera gives pictures: {error}.") from error
        self._take(frames)
        self._end_beats = clock.every(1.0 / (2 * cfg.rate_hz), self._beat)

    def capture(self) -> RGBDImage:
        """The newest picture."""
        with self._lock:
            image, trouble = self._newest, self._trouble
        if trouble:
            raise HardwareError(trouble)
        if image is None or (age := self._clock.now_s - image.stamp_s) > STALE_S:
            raise HardwareError(f"the RealSense camera has sent no picture for {age:.2g} s.")
        return image

    def close(self) -> None:
        """Stop streaming."""
        self._end_beats()
        self._pipeline.stop()

    def _beat(self) -> None:
        try:
            frames = self._pipeline.poll_for_frames()
            if frames:
                self._take(frames)
            self._trouble = ""
        except RuntimeError as error:
            self._trouble = f"the RealSense camera is not connected: {error}."

    def _take(self, frames: Any) -> None:
        arrival, aligned = self._clock.now_s, self._align.process(frames)
        colour, depth = aligned.get_color_frame(), aligned.get_depth_frame()
        if not colour or not depth:
            return
        metres = np.asanyarray(depth.get_data()).astype(np.float32) * self._metres
        seen = (metres > 0) & (metres <= self._cfg.furthest_m)
        image = RGBDImage(
            self._remote.local_s(1e-3 * colour.get_timestamp(), arrival),
            self.frame,
            np.array(np.asanyarray(colour.get_data()), np.uint8),
            np.where(seen, metres, np.nan).astype(np.float32),
            _intrinsics(colour.profile.as_video_stream_profile().get_intrinsics()),
        )
        with self._lock:
            self._newest = image


def _intrinsics(told: Any) -> Intrinsics:
    """As ours: pixel (0, 0) has its centre there in both."""
    return Intrinsics(int(told.width), int(told.height), told.fx, told.fy, told.ppx, told.ppy)
