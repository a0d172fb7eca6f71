"""A calibration as a file, as a static transform, and samples of other tools."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from tr_grasp.calibration.rigid import Array
from tr_grasp.calibration.samples import SETUPS, Setup, rigid
from tr_grasp.calibration.session import Frames
from tr_grasp.calibration.solve import HandEyeResult
from tr_grasp.configs.io import dump_yaml, load_cfg, read_yaml
from tr_grasp.errors import CalibrationError, ConfigError
from tr_grasp.files import write_atomically
from tr_grasp.geometry import invert_transform, matrix_from_wxyz, transform_from, wxyz_from_matrix

Row = tuple[float, float, float, float]
IDENTITY: tuple[Row, ...] = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))  # type: ignore[assignment]
FileFormat = Literal["moveit", "easy_handeye"]


@dataclass(frozen=True)
class CalibrationRecord:
    """A calibration as it is written; matrices are rows, in metres; T_a_b maps b to a."""

    setup: Setup = "eye_on_base"
    """Where the camera is."""

    method: str = ""
    """How it was found."""

    base_frame: str = "base"
    """Name of the robot's frame of poses."""

    tcp_frame: str = "tcp"
    """Name of the frame that moves with the hand."""

    cam_frame: str = "cam"
    """Name of the camera's optical frame."""

    T_base_cam: tuple[Row, ...] | None = None
    """Where the camera is; nothing when it is in the hand."""

    T_tcp_cam: tuple[Row, ...] | None = None
    """Where the camera is in the hand; nothing when it stands beside the robot."""

    T_tcp_board: tuple[Row, ...] | None = None
    """How the hand held the board; eye on base only."""

    T_base_board: tuple[Row, ...] | None = None
    """Where the board lay; eye in hand only."""

    translation_95_m: float = 0.0
    """The camera is within this distance with 95 % confidence (bootstrap)."""

    rotation_95_deg: float = 0.0
    """The same for its rotation."""

    held_out_m: float | None = None
    """Mean error of samples that were not used for solving."""

    held_out_deg: float | None = None
    """The same for rotation."""

    samples_n: int = 0
    """Samples taken."""

    outliers: tuple[str, ...] = ()
    """Samples left out."""

    @property
    def T_parent_cam(self) -> Array:
        """(4, 4) ``T_base_cam`` or ``T_tcp_cam``."""
        rows = self.T_base_cam if self.setup == "eye_on_base" else self.T_tcp_cam
        return np.array(IDENTITY if rows is None else rows)


def record_of(result: HandEyeResult, frames: Frames) -> CalibrationRecord:
    """What is written of a result."""
    matrices = {result.name: _rows(result.T_parent_cam), result.board_name: _rows(result.T_parent_board)}
    turned = result.held_out_rad
    return CalibrationRecord(
        setup=result.setup,
        method=f"{result.method}, {'refined on all corners' if result.refined else 'closed form'}",
        base_frame=frames.base,
        tcp_frame=frames.tcp,
        cam_frame=frames.cam,
        translation_95_m=result.uncertainty.translation_m,
        rotation_95_deg=float(np.degrees(result.uncertainty.rotation_rad)),
        held_out_m=result.held_out_m,
        held_out_deg=None if turned is None else float(np.degrees(turned)),
        samples_n=len(result.samples),
        outliers=tuple(result.outliers),
        **matrices,
    )


def save_calibration(result: HandEyeResult, frames: Frames, path: str | Path) -> Path:
    """Write a result as YAML.

    Raises:
        StorageError: It could not be written.
    """
    path = Path(path)
    write_atomically(path, dump_yaml(record_of(result, frames)))
    return path


def load_calibration(path: str | Path) -> CalibrationRecord:
    """Read what :func:`save_calibration` wrote.

    Raises:
        CalibrationError: No such file, damaged, or its matrix is not rigid.
    """
    try:
        record = load_cfg(CalibrationRecord(), path)
    except ConfigError as error:
        raise CalibrationError(str(error)) from error
    rows = record.T_base_cam if record.setup == "eye_on_base" else record.T_tcp_cam
    if rows is None:
        name = "T_base_cam" if record.setup == "eye_on_base" else "T_tcp_cam"
        raise CalibrationError(f"'{path}' has no {name}, which {record.setup} needs.")
    rigid(f"the camera's transform in '{path}'", np.array(rows))
    return record


def static_transform(record: CalibrationRecord) -> str:
    """The arguments of ROS 2's static transform publisher, which are also the easiest line to read for people."""
    T = record.T_parent_cam
    parent = record.base_frame if record.setup == "eye_on_base" else record.tcp_frame
    (x, y, z), (qw, qx, qy, qz) = T[:3, 3], wxyz_from_matrix(T[:3, :3])
    return (
        f"ros2 run tf2_ros static_transform_publisher --x {x:.6f} --y {y:.6f} --z {z:.6f} "
        f"--qx {qx:.7f} --qy {qy:.7f} --qz {qz:.7f} --qw {qw:.7f} "
        f"--frame-id {parent} --child-frame-id {record.cam_frame}"
    )


def read_samples(path: str | Path, setup: Setup | None = None) -> tuple[Setup | None, list[tuple[Array, Array]]]:
    """Samples of another tool: pairs of ``T_base_tcp`` and ``T_cam_board`` (4, 4).

    Known are MoveIt Calibration's sample file (a list with ``effector_wrt_world`` and ``object_wrt_sensor``, 16 numbers
    row by row) and easy_handeye's (``samples`` with ``robot`` and ``tracking`` or ``optical`` transforms; for a camera
    beside the robot that tool stores the pose of the base in the hand, which is turned round here).

    Args:
        path: The file.
        setup: Where the camera was; the file's own word if not given.

    Returns:
        The setup, if the file or the caller says it, and the pairs.

    Raises:
        CalibrationError: Not readable, another format, a damaged sample (its number is said), or no setup where that
            matters.
    """
    try:
        content = read_yaml(path)
    except ConfigError as error:
        raise CalibrationError(str(error)) from error
    if isinstance(content, list):
        return setup, [_moveit(path, i, entry) for i, entry in enumerate(content, 1)]
    if isinstance(content, dict) and isinstance(content.get("samples"), list):
        said = _setup_of(path, content.get("parameters"), setup)
        return said, [_easy_handeye(path, i, entry, said) for i, entry in enumerate(content["samples"], 1)]
    raise CalibrationError(
        f"'{path}' holds no samples: expected MoveIt Calibration's list of effector_wrt_world and object_wrt_sensor, "
        "or easy_handeye's samples of robot and tracking."
    )


def _moveit(path: str | Path, number: int, entry: Any) -> tuple[Array, Array]:
    return (
        _matrix(path, number, entry, "effector_wrt_world"),
        _matrix(path, number, entry, "object_wrt_sensor"),
    )


def _matrix(path: str | Path, number: int, entry: Any, name: str) -> Array:
    try:
        T = np.array(entry[name], float).reshape(4, 4)
    except (KeyError, TypeError, ValueError) as error:
        raise CalibrationError(f"sample {number} of '{path}' is damaged: {name} must hold 16 numbers.") from error
    return rigid(f"{name} of sample {number} of '{path}'", T)


def _setup_of(path: str | Path, parameters: Any, given: Setup | None) -> Setup:
    said = parameters.get("calibration_type") if isinstance(parameters, dict) else None
    if isinstance(parameters, dict) and "eye_on_hand" in parameters:
        said = "eye_in_hand" if parameters["eye_on_hand"] else "eye_on_base"
    for setup in SETUPS:
        if (given or said) == setup:
            if said in SETUPS and said != setup:
                raise CalibrationError(f"'{path}' was taken {said}, but {setup} was asked for.")
            return setup
    raise CalibrationError(f"'{path}' does not say where the camera was; give the setup: {' or '.join(SETUPS)}.")


def _easy_handeye(path: str | Path, number: int, entry: Any, setup: Setup) -> tuple[Array, Array]:
    robot = _transform(path, number, entry, "robot")
    seen = _transform(path, number, entry, "tracking" if "tracking" in entry else "optical")
    return (robot if setup == "eye_in_hand" else invert_transform(robot)), seen


def _transform(path: str | Path, number: int, entry: Any, name: str) -> Array:
    try:
        t, q = entry[name]["translation"], entry[name]["rotation"]
        xyz, wxyz = [float(t[k]) for k in "xyz"], [float(q[k]) for k in "wxyz"]
    except (KeyError, TypeError, ValueError) as error:
        raise CalibrationError(
            f"sample {number} of '{path}' is damaged: {name} needs translation x, y, z and rotation x, y, z, w."
        ) from error
    if not 0.99 < np.linalg.norm(wxyz) < 1.01:
        raise CalibrationError(f"sample {number} of '{path}' is damaged: the quaternion of {name} has no length of 1.")
    return rigid(f"{name} of sample {number} of '{path}'", transform_from(matrix_from_wxyz(wxyz), xyz))


def _rows(T: Array) -> tuple[Row, ...]:
    return tuple(tuple(float(v) for v in row) for row in np.round(T, 9))  # type: ignore[misc]
