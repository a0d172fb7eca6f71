"""One picture of an evaluation: errors by motion at every horizon, and how honest the covariances are."""

from __future__ import annotations

import io
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tr_grasp.prediction.scores import Scores

Table = Mapping[tuple[str, str], Scores]
"""Scores by (predictor, motion)."""

_MARKERS = "osD^vP*X"
_COLOURS = ("#98a2b3", "#5b6779", "#d2584e", "#d98324", "#7d57c1", "#2b9aa0", "#3b6fd4", "#2f9e66")
_FINEST_MM = 0.01


def errors_picture(table: Table) -> bytes:
    """The picture, PNG."""
    predictors = list(dict.fromkeys(predictor for predictor, _ in table))
    motions = list(dict.fromkeys(motion for _, motion in table))
    horizons = next(iter(table.values())).horizons_s
    panels_n = len(horizons) + 1
    figure = Figure(figsize=(3.3 * panels_n, 1.6 + 0.42 * len(motions)), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, panels_n, squeeze=False)[0]
    for index, horizon in enumerate(horizons):
        _draw_errors(axes[index], table, predictors, motions, index, labels=index == 0)
        axes[index].set_title(f"mean error {horizon:g} s ahead", fontsize=10)
    _draw_honesty(axes[-1], table, predictors)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(predictors), 8), frameon=False, fontsize=9)
    stream = io.BytesIO()
    figure.savefig(stream, dpi=140, format="png")
    return stream.getvalue()


def _draw_errors(
    axes: Axes, table: Table, predictors: list[str], motions: list[str], horizon: int, *, labels: bool
) -> None:
    rows = np.arange(len(motions))
    for number, predictor in enumerate(predictors):
        errors = [table[predictor, motion].mean_mm[horizon] for motion in motions]
        # Markers of one row lie a little above each other, so that equal errors do not hide.
        axes.plot(
            np.maximum(errors, _FINEST_MM), rows + _offset(number, len(predictors)), label=predictor, **_mark(number)
        )
    axes.set_xscale("log")
    axes.set_xlabel("mm")
    axes.set_yticks(rows, [motion.replace("_", " ") for motion in motions] if labels else [""] * len(motions))
    axes.invert_yaxis()
    _style(axes)


def _draw_honesty(axes: Axes, table: Table, predictors: list[str]) -> None:
    for number, predictor in enumerate(predictors):
        scores = Scores.joined([found for (name, _), found in table.items() if name == predictor])
        for level, share in ((68, scores.within_68.mean()), (95, scores.within_95.mean())):
            axes.plot([100 * share], [(level == 95) + _offset(number, len(predictors))], **_mark(number))
    for row, level in enumerate((68, 95)):
        axes.plot([level, level], [row - 0.45, row + 0.45], color="#1c2534", lw=1.2)
    axes.set_yticks([0, 1], ["in the 68 %\nellipsoid", "in the 95 %\nellipsoid"])
    axes.invert_yaxis()
    axes.set_xlim(-3, 103)
    axes.set_xlabel("% of the truth, all motions and horizons")
    axes.set_title("honesty of the covariance", fontsize=10)
    _style(axes)


def _mark(number: int) -> dict[str, Any]:
    return {
        "marker": _MARKERS[number % len(_MARKERS)],
        "color": _COLOURS[number % len(_COLOURS)],
        "ls": "none",
        "ms": 5,
        "alpha": 0.9,
    }


def _offset(number: int, of: int) -> float:
    return 0.5 * (number - (of - 1) / 2) / max(of, 1)


def _style(axes: Axes) -> None:
    axes.grid(axis="x", color="#dfe4ec", lw=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right", "left"):
        axes.spines[side].set_visible(False)
    axes.tick_params(axis="y", length=0)
    axes.tick_params(labelsize=9)
