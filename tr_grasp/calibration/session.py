"""A calibration that is being collected: a folder in which every sample is safe as soon as it is taken."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.closed_form import Method
from tr_grasp.calibration.coverage import Coverage, coverage_of
from tr_grasp.calibration.detection import Detection, DetectionCfg, Reason, Refused, detect_board, pose_information
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.problem import Problem
from tr_grasp.calibration.rigid import Array, angle_rad, distance_m, mean_transform
from tr_grasp.calibration.samples import SETUPS, Sample, Setup
from tr_grasp.calibration.solve import HandEyeResult, solve_hand_eye
from tr_grasp.calibration.views import View, ViewCfg, best_view, reachable_views
from tr_grasp.configs.build import build, plain
from tr_grasp.errors import CalibrationError, ConfigError, unknown_name
from tr_grasp.files import make_folder, remove_partial_files, write_atomically
from tr_grasp.motion import Kinematics

HEADER = "session.json"
NEW_POSE_M, NEW_POSE_DEG = 0.005, 2.0


@dataclass(frozen=True)
class Frames:
    """What the robot's own software calls the frames; they go into the result."""

    base: str = "base"
    """The frame in which the robot tells poses."""

    tcp: str = "tcp"
    """The frame that moves with the hand and whose pose is told."""

    cam: str = "cam"
    """The camera's optical frame: x right, y down, z into the picture."""


@dataclass(frozen=True)
class SessionCfg:
    """What a session is about; it cannot change on the way."""

    setup: Setup = "eye_on_base"
    """Where the camera is."""

    board: BoardSpec = field(default_factory=BoardSpec)
    """The board."""

    camera: Intrinsics = field(default_factory=Intrinsics)
    """The camera."""

    frames: Frames = field(default_factory=Frames)
    """Names of the frames."""


class HandEyeSession:
    """Samples in a folder: ``session.json``, and for each sample ``samples/NAME.json`` beside its picture.

    A sample's picture is written before its numbers, each in one step, so that a stop at any moment leaves whole
    samples only. Make one with :meth:`create` or :meth:`open`.

    Attributes:
        folder: Where it is.
        cfg: What it is about.
        samples: In the order in which they were taken.
    """

    def __init__(self, folder: Path, cfg: SessionCfg, samples: Sequence[Sample] = ()) -> None:
        self.folder, self.cfg, self.samples = folder, cfg, list(samples)

    @classmethod
    def create(cls, folder: str | Path, cfg: SessionCfg) -> HandEyeSession:
        """A new session.

        Raises:
            CalibrationError: There is a session in that folder, or an unknown setup.
            StorageError: It could not be written.
        """
        folder = Path(folder)
        if cfg.setup not in SETUPS:
            raise CalibrationError(unknown_name("setup", str(cfg.setup), SETUPS))
        if (folder / HEADER).exists():
            raise CalibrationError(f"'{folder}' holds a session already; go on with it, or choose another folder.")
        make_folder(folder / "samples")
        write_atomically(folder / HEADER, json.dumps(plain(cfg), indent=2))
        return cls(folder, cfg)

    @classmethod
    def open(cls, folder: str | Path) -> HandEyeSession:
        """Go on with a session; unfinished files of a stopped process are removed.

        Raises:
            CalibrationError: No session there, or a damaged file, which is named.
        """
        folder = Path(folder)
        if not (folder / HEADER).is_file():
            raise CalibrationError(f"no session in '{folder}': it has no {HEADER}.")
        remove_partial_files(folder / "samples")
        try:
            cfg = build(SessionCfg(), _read(folder / HEADER), source=str(folder / HEADER))
        except ConfigError as error:
            raise CalibrationError(str(error)) from error
        paths = sorted((folder / "samples").glob("*.json"))
        return cls(folder, cfg, [_load(path, cfg.camera) for path in paths])

    def add(
        self,
        picture: Array,
        T_base_tcp: ArrayLike,
        *,
        q_rad: ArrayLike | None = None,
        depth_m: Array | None = None,
        detection: DetectionCfg | None = None,
    ) -> Sample | Refused:
        """Find the board in a picture, and save the sample.

        Args:
            picture: (h, w, 3) uint8 RGB, taken while the robot stood still.
            T_base_tcp: (4, 4) pose of the hand at that moment.
            q_rad: Joints, if known.
            depth_m: (h, w) depth [m] in the same pixels, if known.
            detection: How much is asked of the picture.

        Returns:
            The sample, or why the picture was not taken.

        Raises:
            CalibrationError: A picture of another size, or a pose that is not rigid.
            StorageError: It could not be saved.
        """
        seen = detect_board(picture, self.cfg.board, self.cfg.camera, depth_m=depth_m, cfg=detection)
        if isinstance(seen, Refused):
            return seen
        sample = sample_of(self._next_name(), T_base_tcp, seen, q_rad)
        for other in self.samples:
            gap, turn = (measure(sample.T_base_tcp, other.T_base_tcp) for measure in (distance_m, angle_rad))
            if gap < NEW_POSE_M and np.degrees(turn) < NEW_POSE_DEG:
                return Refused(
                    Reason.REPEATED,
                    f"the hand is where it was in sample {other.name} (to {1e3 * gap:.1f} mm and "
                    f"{np.degrees(turn):.1f} degrees); move it, above all turn it.",
                )
        write_atomically(self.picture_path(sample), lambda file: imageio.imwrite(file, picture, extension=".png"))
        self._save(sample)
        return sample

    def add_poses(self, T_base_tcp: ArrayLike, T_cam_board: ArrayLike) -> Sample:
        """Save a sample of which only poses are known; such a session has no reprojection errors and no pictures.

        Raises:
            CalibrationError: A pose that is not rigid.
            StorageError: It could not be saved.
        """
        sample = Sample(self._next_name(), np.asarray(T_base_tcp, float), np.asarray(T_cam_board, float))
        self._save(sample)
        return sample

    def remove(self, name: str) -> None:
        """Take a sample out.

        Raises:
            CalibrationError: No such sample.
        """
        names = [sample.name for sample in self.samples]
        if name not in names:
            raise CalibrationError(unknown_name("sample", name, names))
        sample = self.samples.pop(names.index(name))
        # The numbers make it a sample, so they go first.
        self._path(sample).unlink(missing_ok=True)
        self.picture_path(sample).unlink(missing_ok=True)

    def picture_path(self, sample: Sample) -> Path:
        """Where a sample's picture is."""
        return self.folder / "samples" / f"{sample.name}.png"

    @property
    def coverage(self) -> Coverage:
        """How the hand moved so far, and what is missing."""
        return coverage_of(self.samples)

    def suggest(
        self,
        kinematics: Kinematics,
        X_rough: Array,
        Z_rough: Array,
        rng: np.random.Generator,
        cfg: ViewCfg | None = None,
    ) -> View:
        """The next pose: reachable, the board in view, and the one that tells most beside the samples there are.

        Args:
            kinematics: The arm; its tcp is the frame of the samples.
            X_rough: (4, 4) where the camera is, to a few centimetres.
            Z_rough: (4, 4) where the board is.
            rng: For the candidates.
            cfg: Which sights are looked for.

        Raises:
            CalibrationError: The arm reaches none.
        """
        place = self.cfg.setup, X_rough, Z_rough, self.cfg.board, self.cfg.camera
        return best_view(reachable_views(kinematics, *place, rng, cfg), self.samples, *place)

    def place(self, X_rough: Array | None = None) -> tuple[Array, Array]:
        """Where the camera and the board are: by the samples if they suffice, else by a rough guess of the camera.

        Args:
            X_rough: (4, 4) ``T_base_cam`` or ``T_tcp_cam`` to 10 cm and 10 degrees; then one sample is enough.

        Raises:
            CalibrationError: No samples, or too few of them and no guess.
        """
        if not self.samples:
            raise CalibrationError("there is no sample yet; take one anywhere where the board is in the picture.")
        degenerate = self.coverage.degenerate
        if degenerate is None:
            result = self.solve()
            return result.T_parent_cam, result.T_parent_board
        if X_rough is None:
            raise CalibrationError(
                f"samples do not tell yet where the camera is; say it roughly (X_rough, --camera-at and --looks-at): "
                f"{degenerate}"
            )
        problem = Problem(self.samples, self.cfg.setup)
        return X_rough, mean_transform(problem.hand @ X_rough @ problem.seen)

    def solve(self, method: Method = "daniilidis", *, refine: bool = True) -> HandEyeResult:
        """:func:`tr_grasp.calibration.solve_hand_eye` of these samples."""
        return solve_hand_eye(self.samples, self.cfg.setup, method, refine=refine)

    def _next_name(self) -> str:
        return f"{max((int(sample.name) for sample in self.samples), default=0) + 1:03d}"

    def _path(self, sample: Sample) -> Path:
        return self.folder / "samples" / f"{sample.name}.json"

    def _save(self, sample: Sample) -> None:
        write_atomically(self._path(sample), json.dumps(_record(sample), indent=1))
        self.samples.append(sample)


def sample_of(name: str, T_base_tcp: ArrayLike, seen: Detection, q_rad: ArrayLike | None = None) -> Sample:
    """A board that was found, and where the robot says that its hand was (4, 4), with its joints (dof,) if known."""
    return Sample(
        name, np.asarray(T_base_tcp, float), seen.T_cam_board, seen.information, seen.pixels, seen.points_board,
        seen.reprojection_px, None if q_rad is None else np.asarray(q_rad, float),
    )  # fmt: skip


def _record(sample: Sample) -> dict[str, Any]:
    arrays = ("T_base_tcp", "T_cam_board", "pixels", "points_board", "q_rad")
    record = {name: getattr(sample, name) for name in arrays}
    lists = {name: None if value is None else np.asarray(value).tolist() for name, value in record.items()}
    return {**lists, "reprojection_px": sample.reprojection_px}


def _load(path: Path, camera: Intrinsics) -> Sample:
    record = _read(path)
    try:
        array = {name: None if value is None else np.array(value, float) for name, value in record.items()}
        pixels, points, error = array["pixels"], array["points_board"], record["reprojection_px"]
        T_base_tcp, T_cam_board = array["T_base_tcp"], array["T_cam_board"]
        if T_base_tcp is None or T_cam_board is None:
            raise ValueError("a pose is missing")
        bare = Sample(path.stem, T_base_tcp, T_cam_board, None, pixels, points, error, array["q_rad"])
        if points is None or pixels is None:
            return bare
        if pixels.shape != (len(points), 2) or points.shape[1:] != (3,):
            raise ValueError("corners and points do not belong together")
        return replace(bare, information=pose_information(bare.T_cam_board, points, camera))
    except (KeyError, TypeError, ValueError) as error:
        raise CalibrationError(f"the sample '{path}' is damaged ({error}); delete it, the others are whole.") from error


def _read(path: Path) -> dict[str, Any]:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise CalibrationError(f"'{path}' cannot be read ({error}); delete it, the other files are whole.") from error
    if not isinstance(content, dict):
        raise CalibrationError(f"'{path}' is damaged: it holds no named values; delete it, the other files are whole.")
    return content
