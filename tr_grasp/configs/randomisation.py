"""What differs between episodes: one switch each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class RandomisationCfg:
    """A switch for each randomiser; its range is a setting beside what it varies.

    All of it is drawn from the seed of the episode, each new kind from a stream of its own, so that a switch that is
    turned on leaves what the others draw alone.
    """

    object_properties: bool = True
    """Mass and friction, from objects.mass_range_kg and objects.friction_range; off: the middle of each."""

    object_count: bool = True
    """How many objects, from objects.count_range; off: always the most."""

    object_poses: bool = True
    """Where and how turned objects are dropped; off: the same way in every episode."""

    initial_joints: bool = True
    """Noise on the arm's joints at reset, by initial_joint_noise_rad; off: the home posture."""

    camera_pose: bool = False
    """Where the camera stands, from camera.arc; off: camera.eye_m, looking at camera.target_m."""

    depth_noise: Literal["none", "gaussian", "stereo"] = "gaussian"
    """``gaussian``: independent, by camera.depth_noise_m; ``stereo``: the errors of the device camera.stereo."""

    gravity: bool = False
    """Strength of gravity, normal with gravity_sigma_mps2; drawn with the scene."""

    latency: bool = False
    """Time between a command and its effect, from action.latency_s; drawn once an episode."""

    ground_texture: bool = False
    """A procedural texture on the table, from appearance.texture_*; off: its plain colour."""

    table_colour: bool = False
    """The table's colour, from appearance.table_*; off: its usual one."""

    object_tint: bool = False
    """The objects' colours, by appearance.object_*; drawn with the scene."""

    light: bool = False
    """A sun, from appearance.light_*, that shades what the camera sees; off: colours without shading."""
