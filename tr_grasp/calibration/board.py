"""Calibration boards: ArUco markers in a grid, or ChArUco (markers in the white squares of a chessboard).

Frame ``board``: origin at the upper left corner of the pattern, x to the right and y down the page, z into the page.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import cv2
import numpy as np

from tr_grasp.calibration.rigid import Array
from tr_grasp.errors import CalibrationError, unknown_name

DICTIONARIES = tuple(
    name for name in dir(cv2.aruco) if name.startswith("DICT_") and name.isupper() and "MIP" not in name
)


@dataclass(frozen=True)
class BoardSpec:
    """A board; the defaults are the thesis' grid of six markers."""

    kind: Literal["aruco", "charuco"] = "aruco"
    """aruco: markers with white gaps; charuco: a chessboard with markers in its white squares."""

    columns_n: int = 2
    """Markers, or squares, beside each other."""

    rows_n: int = 3
    """Markers, or squares, above each other."""

    marker_m: float = 0.053
    """Edge of the black square of a marker, measured on the printed board."""

    gap_m: float = 0.005
    """White between two markers; in charuco between a marker and the edge of its square."""

    dictionary: str = "DICT_5X5_250"
    """OpenCV's name for the set of markers."""

    margin_m: float = 0.010
    """White around the pattern."""

    def __post_init__(self) -> None:
        if self.dictionary not in DICTIONARIES:
            raise CalibrationError(unknown_name("dictionary", self.dictionary, DICTIONARIES))
        least = 1 if self.kind == "aruco" else 3
        if min(self.columns_n, self.rows_n) < least:
            raise CalibrationError(
                f"a board of kind {self.kind!r} needs {least} or more columns and rows, "
                f"got {self.columns_n} x {self.rows_n}."
            )
        if self.marker_m <= 0 or self.gap_m <= 0 or self.margin_m < 0:
            raise CalibrationError("marker_m and gap_m must be positive and margin_m not negative, in metres.")
        if self.kind == "aruco" and self.columns_n * self.rows_n == 1:
            raise CalibrationError("one marker alone has an ambiguous pose; give a board of two or more.")
        available = len(self._dictionary.bytesList)
        if self.markers_n > available:
            raise CalibrationError(f"{self.dictionary} has {available} markers, this board needs {self.markers_n}.")

    @property
    def markers_n(self) -> int:
        """Markers on the board."""
        cells = self.columns_n * self.rows_n
        return cells if self.kind == "aruco" else cells // 2

    @property
    def pitch_m(self) -> float:
        """From one marker to the next, or the edge of a square."""
        return self.marker_m + self.gap_m * (1 if self.kind == "aruco" else 2)

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height of the pattern, without the margin."""
        lost = self.gap_m if self.kind == "aruco" else 0.0
        return self.columns_n * self.pitch_m - lost, self.rows_n * self.pitch_m - lost

    @property
    def outline_board(self) -> Array:
        """(4, 3) corners of the paper with its margin [m], clockwise from the upper left."""
        (w, h), m = self.size_m, self.margin_m
        return np.array([[-m, -m, 0.0], [w + m, -m, 0.0], [w + m, h + m, 0.0], [-m, h + m, 0.0]])

    @cached_property
    def cv_board(self) -> Any:
        """The same board for OpenCV: a ``cv2.aruco.Board`` or, for charuco, a ``CharucoBoard``."""
        size = (self.columns_n, self.rows_n)
        if self.kind == "charuco":
            return cv2.aruco.CharucoBoard(size, self.pitch_m, self.marker_m, self._dictionary)
        # OpenCV's GridBoard is the same, but warns of gaps as narrow as the thesis' 5 mm.
        corners = np.array(list(self.marker_corners_board.values()), np.float32)
        return cv2.aruco.Board(list(corners), self._dictionary, np.arange(self.markers_n))

    @cached_property
    def marker_corners_board(self) -> dict[int, Array]:
        """(4, 3) corners [m] of each marker, clockwise from its upper left."""
        if self.kind == "charuco":
            ids, found = np.ravel(self.cv_board.getIds()), self.cv_board.getObjPoints()
            return {int(i): np.asarray(c, float).reshape(4, 3) for i, c in zip(ids, found, strict=True)}
        edge = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]) * self.marker_m
        places = [(c, r, 0.0) for r in range(self.rows_n) for c in range(self.columns_n)]
        return {i: edge + self.pitch_m * np.array(place) for i, place in enumerate(places)}

    @cached_property
    def black_board(self) -> Array:
        """(n, 4) black rectangles [m]: left, top, right, bottom. Together they are everything that is printed."""
        found = [self._marker_cells(number, corners) for number, corners in self.marker_corners_board.items()]
        if self.kind == "charuco":
            p = self.pitch_m
            squares = [
                (c * p, r * p, (c + 1) * p, (r + 1) * p)
                for r in range(self.rows_n)
                for c in range(self.columns_n)
                if (r + c) % 2 == 0
            ]
            found.append(np.array(squares))
        return np.concatenate(found)

    @property
    def words(self) -> str:
        """The board in a line, for people."""
        name = "ArUco grid" if self.kind == "aruco" else "ChArUco board"
        return (
            f"{name} {self.columns_n} x {self.rows_n}, {self.dictionary}, "
            f"marker {1e3 * self.marker_m:g} mm, gap {1e3 * self.gap_m:g} mm"
        )

    @property
    def _dictionary(self) -> cv2.aruco.Dictionary:
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))

    def _marker_cells(self, number: int, corners: Array) -> Array:
        """Black runs of each row of a marker's cells, as rectangles (n, 4)."""
        cells = self._dictionary.markerSize + 2
        black = cv2.aruco.generateImageMarker(self._dictionary, number, cells) < 128
        edge, (x, y) = self.marker_m / cells, corners[0, :2]
        found = []
        for row, line in enumerate(black):
            changes = np.flatnonzero(np.diff(np.r_[False, line, False].astype(int)))
            for start, stop in changes.reshape(-1, 2):
                found.append((x + start * edge, y + row * edge, x + stop * edge, y + (row + 1) * edge))
        return np.array(found)
