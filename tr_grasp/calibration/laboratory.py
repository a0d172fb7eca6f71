"""A laboratory that is simulated: an arm, a board, a colour camera, and a truth to compare a calibration with."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.rendering import Eye, ImageNoise, RaycastEye, exposed
from tr_grasp.calibration.rigid import Array, transform_of
from tr_grasp.calibration.samples import Sample, Setup
from tr_grasp.calibration.views import View, best_view, reachable_views
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import invert_transform, look_at, transform_from
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec


@dataclass(frozen=True)
class IntrinsicsError:
    """How far the intrinsics that calibration is told are from those of the camera; exact by default."""

    focal: float = 0.0
    """Relative error of the focal lengths, a standard deviation; drivers are off by 0.001 to 0.005."""

    centre_px: float = 0.0
    """Error of the optical centre along a row and along a column, a standard deviation."""

    distortion: float = 0.0
    """Part of the lens distortion that is not known: 0 all is known, 1 it is left out."""


@dataclass(frozen=True)
class LabCfg:
    """What is in the laboratory, and what goes wrong in it."""

    setup: Setup = "eye_on_base"
    """eye_on_base: the hand holds the board; eye_in_hand: the hand holds the camera, the board lies on the table."""

    robot: str = "j2s7s300"
    """Name of the arm."""

    board: BoardSpec = field(default_factory=BoardSpec)
    """The board."""

    camera: Intrinsics = field(default_factory=Intrinsics)
    """The colour camera with its lens; a D415 without distortion by default."""

    intrinsics_error: IntrinsicsError = field(default_factory=IntrinsicsError)
    """What calibration does not know of it."""

    image: ImageNoise = field(default_factory=ImageNoise)
    """Blur and noise of its pictures."""

    kinematics_position_m: float = 0.0
    """Error of the pose that the robot tells, a standard deviation along each axis."""

    kinematics_rotation_deg: float = 0.0
    """The same about each axis."""

    wrong_samples_n: int = 0
    """Samples whose robot pose is 30 mm and 5 degrees off, as if it had been read at another moment."""

    seed: int = 0
    """Of everything that is random."""


@dataclass(frozen=True, eq=False)
class Shot:
    """A picture (h, w, 3), the pose that the robot tells, its joints, and whether this one is wrong on purpose."""

    picture: Array
    T_base_tcp: Array
    q_rad: Array
    is_wrong: bool


class Laboratory:
    """An arm and a camera of which everything is known.

    Args:
        cfg: What is in it.
        eye: Takes its pictures; ray-cast, if not given.

    Attributes:
        X: True ``T_base_cam`` or ``T_tcp_cam``.
        Z: True ``T_tcp_board`` or ``T_base_board``.
        X_rough: The camera as one would measure it with a tape: 30 mm and 4 degrees off.
    """

    def __init__(self, cfg: LabCfg, eye: Eye | None = None) -> None:
        self.cfg = cfg
        self._eye = eye or RaycastEye(cfg.board)
        self.rng = np.random.default_rng(cfg.seed)
        self.kinematics = Kinematics(robot_spec(cfg.robot))
        self.X, self.Z = self._places()
        self.X_rough = self.X @ transform_of(self._away(0.030, np.radians(4.0)))

    @property
    def told_camera(self) -> Intrinsics:
        """The camera as calibration knows it; its errors depend on the seed alone."""
        camera, error = self.cfg.camera, self.cfg.intrinsics_error
        focal, right, down = np.random.default_rng((self.cfg.seed, 1)).normal(size=3)
        return replace(
            camera,
            fx_px=camera.fx_px * (1 + error.focal * focal),
            fy_px=camera.fy_px * (1 + error.focal * focal),
            cx_px=camera.cx_px + error.centre_px * right,
            cy_px=camera.cy_px + error.centre_px * down,
            distortion=tuple((1 - error.distortion) * k for k in camera.distortion),
        )

    def choose_views(self, views_n: int, pool_n: int = 2) -> list[View]:
        """Poses to take samples at, each the one that tells most beside those before it.

        Args:
            views_n: How many.
            pool_n: Rounds of candidates to choose from.

        Raises:
            CalibrationError: The arm reaches too few.
        """
        pool: list[View] = []
        for _ in range(pool_n):
            pool += reachable_views(
                self.kinematics, self.cfg.setup, self.X_rough, self.Z, self.cfg.board, self.cfg.camera, self.rng
            )
        pool = [view for view in pool if self._is_seen(view)]
        if len(pool) < views_n:
            raise CalibrationError(f"{views_n} views were asked for, the arm reaches {len(pool)} of those tried.")
        chosen: list[View] = []
        while len(chosen) < views_n:
            taken = [Sample("", view.T_base_tcp, view.T_cam_board) for view in chosen]
            view = best_view(pool, taken, self.cfg.setup, self.X_rough, self.Z, self.cfg.board, self.cfg.camera)
            pool.remove(view)
            chosen.append(view)
        return chosen

    def shoot(self, view: View, is_wrong: bool = False) -> Shot:
        """Go there, take a picture, ask the robot where it is."""
        T_true = self.kinematics.pose(view.q_rad)
        T_base_cam, T_base_board = self.seen_from(T_true)
        picture = exposed(
            self._eye.picture(self.cfg.camera, T_base_cam, T_base_board, view.q_rad), self.cfg.image, self.rng
        )
        return Shot(picture, self.told(T_true, is_wrong), view.q_rad, is_wrong)

    def told(self, T_base_tcp: Array, is_wrong: bool = False) -> Array:
        """What the robot says of its pose: with noise, and with an error of 30 mm and 5 degrees in a wrong sample."""
        spread = np.r_[
            np.full(3, self.cfg.kinematics_position_m), np.full(3, np.radians(self.cfg.kinematics_rotation_deg))
        ]
        told = T_base_tcp @ transform_of(self.rng.normal(size=6) * spread)
        return told @ transform_of(self._away(0.030, np.radians(5.0))) if is_wrong else told

    def shoot_all(self, views: list[View]) -> list[Shot]:
        """A picture at each view; the wrong ones are drawn by chance."""
        wrong = set(self.rng.permutation(len(views))[: self.cfg.wrong_samples_n].tolist())
        return [self.shoot(view, i in wrong) for i, view in enumerate(views)]

    def T_cam_board(self, T_base_tcp: Array) -> Array:
        """Where the camera truly sees the board, (4, 4)."""
        T_base_cam, T_base_board = self.seen_from(T_base_tcp)
        return invert_transform(T_base_cam) @ T_base_board

    def seen_from(self, T_base_tcp: Array) -> tuple[Array, Array]:
        """Where camera and board truly are, ``T_base_cam`` and ``T_base_board``."""
        if self.cfg.setup == "eye_in_hand":
            return T_base_tcp @ self.X, self.Z
        return self.X, T_base_tcp @ self.Z

    def with_cfg(self, **changes: object) -> Laboratory:
        """The same places, with other noise: to compare conditions on one set of views."""
        other = object.__new__(Laboratory)
        other.__dict__.update(self.__dict__)
        other.cfg = replace(self.cfg, **changes)  # type: ignore[arg-type]
        return other

    def _is_seen(self, view: View) -> bool:
        """Whether the board is in the picture where the camera truly is, not only where it was thought to be."""
        T = self.T_cam_board(view.T_base_tcp)
        outline = self.cfg.board.outline_board @ T[:3, :3].T + T[:3, 3]
        return bool((outline[:, 2] > 0.2).all()) and self.cfg.camera.sees(self.cfg.camera.project(outline), 2.0)

    def _places(self) -> tuple[Array, Array]:
        """X and Z of this seed."""
        width, height = self.cfg.board.size_m
        jitter = transform_of(self._away(0.010, np.radians(3.0)))
        if self.cfg.setup == "eye_on_base":
            eye = np.array([0.05, -1.15, 0.62]) + self.rng.uniform(-0.05, 0.05, 3)
            target = np.array([0.0, -0.48, 0.45]) + self.rng.uniform(-0.03, 0.03, 3)
            # Held at its lower edge; the page's y points back to the hand, its face to the tcp's -y.
            R = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
            return look_at(eye, target), transform_from(R, (-width / 2, 0.0, height + 0.015)) @ jitter
        # Beside the wrist, looking the way the hand does; the board on the table in front of the arm.
        camera = transform_from(np.eye(3), (0.0, -0.08, -0.10)) @ transform_of(np.r_[0, 0, 0, -0.12, 0, 0])
        board = transform_from(np.diag([1.0, -1.0, -1.0]), (-width / 2, -0.45 + height / 2, 0.0))
        return camera @ jitter, board @ transform_of(
            np.r_[self.rng.uniform(-0.03, 0.03, 2), 0, 0, 0, self.rng.uniform(-0.5, 0.5)]
        )

    def _away(self, shift_m: float, turn_rad: float) -> Array:
        """A small motion (6,) of exactly that size in a random direction."""
        shift, turn = (v / np.linalg.norm(v) for v in self.rng.normal(size=(2, 3)))
        return np.r_[shift_m * shift, turn_rad * turn]
