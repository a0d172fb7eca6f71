"""A recorded camera behind the names of pyrealsense2: pictures out of an ``.npz`` file, one every 33 ms of a world.

The file holds ``rgb`` (n, h, w, 3) uint8, ``depth`` (n, h, w) uint16 in counts, ``scale`` metres a count, and
``intrinsics`` (fx, fy, ppx, ppy). Depth is aligned already.
"""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

BOOT_MS = 9e6


class _Frame:
    def __init__(self, data, stamp_ms, intrinsics):
        self._data, self._stamp_ms = data, stamp_ms
        video = SimpleNamespace(get_intrinsics=lambda: intrinsics)
        self.profile = SimpleNamespace(as_video_stream_profile=lambda: video)

    def get_data(self):
        return self._data

    def get_timestamp(self):
        return self._stamp_ms


class _Frames:
    def __init__(self, colour=None, depth=None):
        self._colour, self._depth = colour, depth

    def __bool__(self):
        return self._colour is not None

    def get_color_frame(self):
        return self._colour

    def get_depth_frame(self):
        return self._depth


class RecordedRealSense:
    """Stands for the module; ``plugged`` is the cable."""

    stream = SimpleNamespace(color="color", depth="depth")
    format = SimpleNamespace(rgb8="rgb8", z16="z16")

    def __init__(self, path, world, rate_hz=30.0):
        file = np.load(path)
        self.rgb, self.depth, self.scale, self.told = (file[k] for k in ("rgb", "depth", "scale", "intrinsics"))
        self.world, self.period_s, self.given, self.plugged, self.frozen = world, 1 / rate_hz, -1, True, False
        self.stopped = False

    def config(self):
        return SimpleNamespace(enable_stream=self.enable_stream, enable_device=lambda serial: None)

    def enable_stream(self, stream, width, height, kind, rate):
        self.asked = height, width

    def align(self, to):
        assert to == self.stream.color
        return SimpleNamespace(process=lambda frames: frames)

    def pipeline(self):
        return self

    def start(self, config):
        if not self.plugged:
            raise RuntimeError("No device connected")
        if self.asked != self.rgb.shape[1:3]:
            raise RuntimeError("Couldn't resolve requests")
        sensor = SimpleNamespace(get_depth_scale=lambda: float(self.scale))
        device = SimpleNamespace(first_depth_sensor=lambda: sensor)
        return SimpleNamespace(get_device=lambda: device)

    def stop(self):
        self.stopped = True

    def wait_for_frames(self, timeout_ms=5000):
        frames = self.poll_for_frames()
        if not frames:
            raise RuntimeError(f"Frame didn't arrive within {timeout_ms}")
        return frames

    def poll_for_frames(self):
        if not self.plugged:
            raise RuntimeError("Device disconnected")
        number = int(self.world.now_s / self.period_s + 1e-9)
        if number == self.given or self.frozen:
            return _Frames()
        self.given, i = number, number % len(self.rgb)
        fx, fy, ppx, ppy = map(float, self.told)
        height, width = self.rgb.shape[1:3]
        intrinsics = SimpleNamespace(width=width, height=height, fx=fx, fy=fy, ppx=ppx, ppy=ppy)
        stamp_ms = BOOT_MS + 1e3 * number * self.period_s
        return _Frames(_Frame(self.rgb[i], stamp_ms, intrinsics), _Frame(self.depth[i], stamp_ms, intrinsics))
