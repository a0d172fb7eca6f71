"""Flags of the parts of ``tr-grasp calibrate``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.closed_form import Method
from tr_grasp.calibration.laboratory import LabCfg
from tr_grasp.calibration.samples import Setup
from tr_grasp.calibration.session import SessionCfg


@dataclass(frozen=True)
class BoardCfg:
    """Print a calibration board at its true size, with a line of 100 mm to check the printer with."""

    out: Positional[Path] = Path("board.pdf")
    """The file; .pdf has exact lines, .png is made of pixels and knows its resolution."""

    board: BoardSpec = field(default_factory=BoardSpec)
    """The board."""

    paper: Literal["a4", "a3", "letter"] = "a4"
    """What it is printed on."""

    dpi: int = 600
    """Resolution of a PNG."""


@dataclass(frozen=True)
class SimulateCfg:
    """Calibrate in a simulated laboratory whose truth is known; the session is kept as a real one would be."""

    lab: LabCfg = field(default_factory=LabCfg)
    """The laboratory."""

    pictures: Literal["raycast", "sapien"] = "raycast"
    """Who takes the pictures: raycast shows a board before a wall; sapien renders arm, table and shadows too, and needs
    a Vulkan device."""

    samples: int = 11
    """Pictures to take."""

    method: Method = "daniilidis"
    """Solver of the closed form."""

    out: Path | None = None
    """Folder of the session; by default runs/calibration/SETUP_seedN."""


@dataclass(frozen=True)
class NewCfg:
    """Start a session: a folder in which every sample is safe as soon as it is taken."""

    folder: Positional[Path]
    """The folder."""

    session: SessionCfg = field(default_factory=SessionCfg)
    """What it is about."""


@dataclass(frozen=True)
class AddCfg:
    """Add a picture and the pose that the robot told when it was taken."""

    folder: Positional[Path]
    """Folder of the session."""

    picture: Positional[Path]
    """PNG or JPEG."""

    pose: tuple[float, float, float, float, float, float, float] | None = None
    """T_base_tcp as x y z [m] and quaternion w x y z."""

    joints: tuple[float, ...] | None = None
    """Joints [rad] instead of a pose; needs a robot."""

    robot: str | None = None
    """Name of the robot, or a YAML file about yours."""


@dataclass(frozen=True)
class StatusCfg:
    """Say what was moved so far and what is missing; with a robot also where to go next."""

    folder: Positional[Path]
    """Folder of the session."""

    robot: str | None = None
    """Name of the robot, or a YAML file about yours: then the next pose is suggested."""

    camera_at: tuple[float, float, float] | None = None
    """Roughly where the camera is [m], in the base's frame or in the tcp's: needed until the samples can tell."""

    looks_at: tuple[float, float, float] | None = None
    """A point in the middle of its picture, in the same frame."""

    up: tuple[float, float, float] | None = None
    """What is up in the picture, in the same frame; z of the base, or -y of the tcp, if not given."""

    seed: int = 0
    """Of the suggestion."""


@dataclass(frozen=True)
class SolveCfg:
    """Calibrate from a session, and write calibration.yaml into its folder."""

    folder: Positional[Path]
    """Folder of the session."""

    method: Method = "daniilidis"
    """Solver of the closed form; shah and li solve for robot and world at once."""

    refine: bool = True
    """Go on to the least squares of all corners."""


@dataclass(frozen=True)
class ImportCfg:
    """Make a session of samples of MoveIt Calibration or easy_handeye (poses only, no pictures)."""

    file: Positional[Path]
    """The sample file."""

    folder: Positional[Path]
    """Folder of the new session."""

    setup: Setup | None = None
    """Where the camera was, if the file does not say it."""
