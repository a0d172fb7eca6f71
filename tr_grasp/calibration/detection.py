"""Where a board is in a picture, or in one sentence why it cannot be used."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import cv2
import numpy as np

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.edges import refine_quads
from tr_grasp.calibration.intrinsics import Intrinsics
from tr_grasp.calibration.rigid import Array, skew, transform_of
from tr_grasp.errors import CalibrationError

REACH = 0.6
"""Part of the white beside an edge that is looked at: the blur of the next print reaches into the rest."""


FAMILIES = (
    "DICT_4X4_1000", "DICT_5X5_1000", "DICT_6X6_1000", "DICT_7X7_1000", "DICT_ARUCO_ORIGINAL", "DICT_APRILTAG_36H11",
)  # fmt: skip
"""Sets that hold the smaller ones of their kind."""


class Reason(enum.Enum):
    """Why a picture is not taken."""

    NOT_VISIBLE = "board not visible"
    TOO_SMALL = "board too small in the picture"
    WRONG_DICTIONARY = "wrong dictionary"
    WRONG_BOARD = "another board"
    WRONG_SIZE = "wrong size"
    MIRRORED = "mirrored picture"
    BLURRED = "blurred picture"
    REPEATED = "pose repeated"


@dataclass(frozen=True)
class Refused:
    """A picture that is not taken, and what to do."""

    reason: Reason
    sentence: str


@dataclass(frozen=True)
class DetectionCfg:
    """How much is asked of a picture."""

    corners_share: float = 0.5
    """Part of the board's corners that must be seen."""

    marker_px: float = 12.0
    """Least edge of a marker, in the median."""

    blur_px: float = 1.3
    """Largest width of an edge (standard deviation); sharp pictures have 0.6 to 0.9."""

    reprojection_px: float = 1.5
    """Largest error of the corners against the board, root mean square."""

    depth_disagreement: float = 0.03
    """Largest relative difference between the distance that the markers' size and that the depth picture tells."""


@dataclass(frozen=True, eq=False)
class Detection:
    """A board that was found.

    Attributes:
        T_cam_board: (4, 4) its pose.
        pixels: (n, 2) corners [px].
        points_board: (n, 3) the same corners on the board [m].
        information: (6, 6) of the pose per squared pixel: inverse covariance if every corner is off by 1 px.
        reprojection_px: Root mean square distance between corners and where the pose puts them.
        blur_px: Width of the edges, as a standard deviation.
    """

    T_cam_board: Array
    pixels: Array
    points_board: Array
    information: Array = field(repr=False)
    reprojection_px: float
    blur_px: float


def detect_board(
    picture: Array,
    board: BoardSpec,
    camera: Intrinsics,
    *,
    depth_m: Array | None = None,
    cfg: DetectionCfg | None = None,
) -> Detection | Refused:
    """Find a board.

    Args:
        picture: (h, w) grey or (h, w, 3) RGB, uint8.
        board: What to look for.
        camera: What took the picture.
        depth_m: (h, w) depth [m] in the same pixels, if there is any: then a wrong size of the markers is noticed.
        cfg: How much is asked of the picture.

    Raises:
        CalibrationError: The picture has another size than the camera's, or is no 8-bit picture.
    """
    cfg = cfg or DetectionCfg()
    grey = _grey(picture, camera)
    numbers, quads = _find_markers(grey, board.dictionary)
    own = [i for i, number in enumerate(numbers) if number in board.marker_corners_board]
    if not own:
        return _why_nothing(grey, board, numbers)
    if len(own) < len(numbers):
        return Refused(
            Reason.WRONG_BOARD,
            f"markers {', '.join(str(n) for n in numbers if n not in board.marker_corners_board)} are not on this "
            f"board ({board.words}); check columns and rows, or take other markers out of sight.",
        )
    numbers, quads = [numbers[i] for i in own], quads[own]
    edges_px = np.linalg.norm(quads - np.roll(quads, 1, axis=1), axis=-1)
    side_px = edges_px.mean(1)
    if np.median(side_px) < cfg.marker_px:
        return Refused(
            Reason.TOO_SMALL,
            f"markers are {np.median(side_px):.0f} pixels wide, {cfg.marker_px:.0f} are needed; bring it nearer.",
        )
    rounds_n = 2 if board.kind == "aruco" else 1  # there the corners are those of the chessboard
    refined = refine_quads(grey, quads, _reach_px(board, edges_px.min(1)), rounds_n)
    blur = float(np.percentile(refined.blur_px.max(1), 50))
    pixels, points = _corners(grey, board, numbers, quads, refined.corners_px)
    asked = (4 * board.markers_n) if board.kind == "aruco" else (board.columns_n - 1) * (board.rows_n - 1)
    if blur > cfg.blur_px:
        return Refused(
            Reason.BLURRED,
            f"edges are {blur:.1f} pixels wide, at most {cfg.blur_px:g} can be used; hold still, focus, or give light.",
        )
    if len(points) < max(6, cfg.corners_share * asked):
        return Refused(
            Reason.NOT_VISIBLE,
            f"{len(points)} of {asked} corners of the board are visible, at least "
            f"{max(6, int(np.ceil(cfg.corners_share * asked)))} are needed; show all of it.",
        )
    return _pose_or_reason(pixels, points, board, camera, depth_m, blur, cfg)


def pose_information(T_cam_board: Array, points_board: Array, camera: Intrinsics) -> Array:
    """(6, 6) inverse covariance of a board's pose (motion in the board's frame) if every corner is off by 1 px."""
    J = np.concatenate([np.tile(np.eye(3), (len(points_board), 1, 1)), -skew(points_board)], axis=2)
    p = points_board @ T_cam_board[:3, :3].T + T_cam_board[:3, 3]
    x, y, z = p.T
    zero = np.zeros_like(x)
    lens = np.stack(
        [np.stack([camera.fx_px / z, zero, -camera.fx_px * x / z**2], -1),
         np.stack([zero, camera.fy_px / z, -camera.fy_px * y / z**2], -1)], axis=1,
    )  # fmt: skip
    J = (lens @ T_cam_board[:3, :3] @ J).reshape(-1, 6)
    return J.T @ J


def _pose_or_reason(
    pixels: Array, points: Array, board: BoardSpec, camera: Intrinsics, depth_m: Array | None, blur: float,
    cfg: DetectionCfg,
) -> Detection | Refused:  # fmt: skip
    T, error = _pose(pixels, points, camera)
    if error > cfg.reprojection_px:
        return Refused(
            Reason.WRONG_BOARD,
            f"corners are {error:.1f} pixels from where {board.words} would have them; measure marker and gap, "
            f"check columns and rows, keep the board flat, and check the camera's focal length.",
        )
    ratio = None if depth_m is None else _depth_ratio(T, points, camera, depth_m)
    if ratio is not None and abs(ratio - 1) > cfg.depth_disagreement:
        return Refused(
            Reason.WRONG_SIZE,
            f"by the depth picture the board is {ratio:.3f} times as far as its markers' size tells; measure a marker: "
            f"it is probably {1e3 * board.marker_m * ratio:.1f} mm, not {1e3 * board.marker_m:.1f} mm.",
        )
    return Detection(T, pixels, points, pose_information(T, points, camera), error, blur)


def _pose(pixels: Array, points: Array, camera: Intrinsics) -> tuple[Array, float]:
    """``T_cam_board`` and the reprojection error [px]: the better of a plane's two poses, both refined."""
    found, turns, shifts, _ = cv2.solvePnPGeneric(
        points, pixels, camera.matrix, camera.coefficients, flags=cv2.SOLVEPNP_IPPE
    )
    best: tuple[Array, float] = np.eye(4), np.inf
    for turn, shift in zip(turns[:found], shifts[:found], strict=True):
        turn, shift = cv2.solvePnPRefineLM(points, pixels, camera.matrix, camera.coefficients, turn, shift)
        T = transform_of(np.r_[np.ravel(shift), np.ravel(turn)])
        gaps = camera.project(points @ T[:3, :3].T + T[:3, 3]) - pixels
        error = float(np.sqrt((gaps**2).sum(1).mean()))
        if T[2, 3] > 0 and error < best[1]:
            best = T, error
    return best


def _depth_ratio(T: Array, points: Array, camera: Intrinsics, depth_m: Array) -> float | None:
    """Measured over expected depth in the middle of the corners; nothing where no depth was measured."""
    points_cam = points @ T[:3, :3].T + T[:3, 3]
    at = np.rint(camera.project(points_cam)).astype(int)
    inside = (at >= 0).all(1) & (at < [camera.width_px, camera.height_px]).all(1)
    depth = depth_m[at[inside, 1], at[inside, 0]]
    valid = np.isfinite(depth) & (depth > 0)
    if valid.sum() < 6:
        return None
    return float(np.median(depth[valid] / points_cam[inside, 2][valid]))


def _find_markers(grey: Array, dictionary: str) -> tuple[list[int], Array]:
    """Numbers and corners (n, 4, 2) [px], clockwise from the upper left."""
    cfg = cv2.aruco.DetectorParameters()
    cfg.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    corners, ids, _ = cv2.aruco.ArucoDetector(words, cfg).detectMarkers(grey)
    if ids is None or not len(corners):
        return [], np.zeros((0, 4, 2))
    return [int(i) for i in np.ravel(ids)], np.array(corners, float).reshape(-1, 4, 2)


def _corners(grey: Array, board: BoardSpec, numbers: list[int], rough: Array, quads: Array) -> tuple[Array, Array]:
    """Pixels (n, 2) and points (n, 3) that the pose is found from."""
    if board.kind == "aruco":
        return quads.reshape(-1, 2), np.concatenate([board.marker_corners_board[n] for n in numbers])
    corners = [quad.reshape(1, 4, 2).astype(np.float32) for quad in rough]
    found, ids, _, _ = cv2.aruco.CharucoDetector(board.cv_board).detectBoard(
        grey, markerCorners=corners, markerIds=np.array(numbers, np.int32).reshape(-1, 1)
    )
    if ids is None or not len(np.ravel(ids)):
        return np.zeros((0, 2)), np.zeros((0, 3))
    every = np.asarray(board.cv_board.getChessboardCorners(), float)
    return np.asarray(found, float).reshape(-1, 2), every[np.ravel(ids).astype(int)]


def _reach_px(board: BoardSpec, side_px: Array) -> Array:
    """How far from a marker's edge the next print is, inwards (one cell) or outwards (the gap)."""
    cell = 1 / (board.cv_board.getDictionary().markerSize + 2)
    return REACH * side_px * min(cell, board.gap_m / board.marker_m)


def _why_nothing(grey: Array, board: BoardSpec, foreign: list[int]) -> Refused:
    """A board of another dictionary, a mirrored one, or none."""
    mirrored, _ = _find_markers(np.ascontiguousarray(grey[:, ::-1]), board.dictionary)
    if sum(number in board.marker_corners_board for number in mirrored) >= 2:
        return Refused(
            Reason.MIRRORED, "the picture is mirrored; switch off the mirror image of the camera or its driver."
        )
    others = [name for name in FAMILIES if name.rpartition("_")[0] != board.dictionary.rpartition("_")[0]]
    seen = {name: len(_find_markers(grey, name)[0]) for name in others}
    best = max(others, key=lambda name: seen[name])
    if seen[best] >= 2:
        return Refused(
            Reason.WRONG_DICTIONARY,
            f"the picture shows {seen[best]} markers of {best}, but the board was given as {board.dictionary}.",
        )
    if foreign:
        return Refused(
            Reason.WRONG_BOARD, f"markers {', '.join(map(str, foreign))} are not on this board ({board.words})."
        )
    return Refused(
        Reason.NOT_VISIBLE,
        "no marker of the board was found; bring it into view, near and sharp, with light and without glare.",
    )


def _grey(picture: Array, camera: Intrinsics) -> Array:
    if picture.dtype != np.uint8 or picture.ndim not in (2, 3) or (picture.ndim == 3 and picture.shape[2] != 3):
        raise CalibrationError(
            f"a picture must be uint8, grey (h, w) or RGB (h, w, 3), got {picture.dtype} {picture.shape}."
        )
    if picture.shape[:2] != (camera.height_px, camera.width_px):
        raise CalibrationError(
            f"the picture has {picture.shape[1]} x {picture.shape[0]} pixels, the camera "
            f"{camera.width_px} x {camera.height_px}; give the intrinsics of this resolution."
        )
    return picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
