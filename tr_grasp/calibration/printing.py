"""A board on paper at its true size, as PDF (exact lines) or PNG (with its resolution in the file)."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import FigureCanvasPdf
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline

from tr_grasp.calibration.board import BoardSpec
from tr_grasp.calibration.rigid import Array
from tr_grasp.errors import CalibrationError
from tr_grasp.files import make_folder, write_atomically

PAPERS_MM = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}
CHECK_MM = 100.0
MM_PER_INCH = 25.4


def print_board(board: BoardSpec, path: str | Path, *, paper: str = "a4", dpi: int = 600) -> Path:
    """Write a page with the board, what it is, and a line of 100 mm to check the printer's scale with.

    Args:
        board: What to print.
        path: Ends in ``.pdf`` or ``.png``; its folder is made.
        paper: ``a4``, ``a3`` or ``letter``; turned to landscape where the board needs it.
        dpi: Resolution of a PNG.

    Raises:
        CalibrationError: Another ending or paper, or the board does not fit.
        StorageError: It could not be written.
    """
    path = Path(path)
    if path.suffix not in (".pdf", ".png"):
        raise CalibrationError(f"a board is printed to a .pdf or .png file, got '{path}'.")
    if not 72 <= dpi <= 2400:
        raise CalibrationError(f"dpi must be 72 to 2400, got {dpi}.")
    figure = _figure(board, _page(board, paper))
    buffer = io.BytesIO()
    if path.suffix == ".pdf":
        FigureCanvasPdf(figure).print_pdf(buffer, metadata={"Title": board.words})
    else:
        figure.set_dpi(dpi)
        FigureCanvasAgg(figure).print_png(buffer, pil_kwargs={"dpi": (dpi, dpi)}, metadata={"Title": board.words})
    make_folder(path.parent)
    write_atomically(path, buffer.getvalue())
    return path


def _page(board: BoardSpec, paper: str) -> tuple[float, float]:
    """Width and height [mm] of the paper, upright or across."""
    if paper not in PAPERS_MM:
        raise CalibrationError(f"unknown paper {paper!r}; valid: {', '.join(PAPERS_MM)}.")
    short, long = PAPERS_MM[paper]
    w, h = (1e3 * (edge + 2 * board.margin_m) for edge in board.size_m)
    for page in ((short, long), (long, short)):
        if w <= page[0] - 20 and h <= page[1] - 50:
            return page
    raise CalibrationError(f"a board of {w:.0f} x {h:.0f} mm does not fit on {paper}; choose a larger paper.")


def _figure(board: BoardSpec, page_mm: tuple[float, float]) -> Figure:
    width, height = page_mm
    figure = Figure(figsize=(width / MM_PER_INCH, height / MM_PER_INCH), facecolor="white")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, width)
    axes.set_ylim(height, 0)
    w, h = (1e3 * edge for edge in board.size_m)
    left, top = (width - w) / 2, (height - 30 - h) / 2
    axes.add_patch(_black(1e3 * board.black_board + np.array([left, top, left, top])))
    below = height - 26
    start = (width - CHECK_MM) / 2
    axes.plot([start, start + CHECK_MM], [below, below], color="black", lw=0.8, solid_capstyle="butt")
    for x in (start, start + CHECK_MM):
        axes.plot([x, x], [below - 2, below + 2], color="black", lw=0.8)
    axes.text(width / 2, below + 5, board.words, ha="center", va="top", fontsize=9)
    axes.text(
        width / 2, below + 10, "Print at 100 %: the line above is 100 mm long. Glue it on something flat and stiff.",
        ha="center", va="top", fontsize=8, color="0.35",
    )  # fmt: skip
    return figure


def _black(rectangles_mm: Array) -> PathPatch:
    """All rectangles as one shape: shapes of their own would leave hairlines between neighbours."""
    corners = [[(a, b), (c, b), (c, d), (a, d), (a, b)] for a, b, c, d in rectangles_mm]
    codes = [Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY] * len(corners)
    return PathPatch(Outline(np.reshape(corners, (-1, 2)), codes), facecolor="black", edgecolor="none", linewidth=0)
