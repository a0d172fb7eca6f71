"""The log of a run as pictures: what the camera saw, how far it was, where the tool was, what the policy did."""

from __future__ import annotations

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tr_grasp.deploy.log import RunLog

SIZE_IN, DPI = (9.6, 3.0), 80
ACTIONS = ("dx", "dy", "dz", "turn", "grip")
BLUE, ORANGE, GREY = "#3b6fd4", "#d98324", "#9aa5b5"


def log_frames(log: RunLog) -> list[NDArray[np.uint8]]:
    """A picture (h, w, 3) for each step."""
    tool = np.array([step.proprio[-1][1:4] for step in log.steps])
    near, far = _depth_range(log)
    return [_frame(log, k, tool, near, far) for k in range(len(log.steps))]


def _depth_range(log: RunLog) -> tuple[float, float]:
    depth = np.concatenate([step.depth_m[np.isfinite(step.depth_m)] for step in log.steps])
    return (float(depth.min()), float(depth.max())) if len(depth) else (0.0, 1.0)


def _frame(log: RunLog, k: int, tool: NDArray[np.floating], near: float, far: float) -> NDArray[np.uint8]:
    step = log.steps[k]
    figure = Figure(SIZE_IN, DPI, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    colour, depth, path, bars = figure.subplots(1, 4)
    colour.imshow(step.rgb)
    colour.set_title(f"step {k + 1} of {len(log.steps)}", fontsize=8)
    depth.imshow(step.depth_m, vmin=near, vmax=far, cmap="viridis")
    depth.set_title("depth", fontsize=8)
    for axes in (colour, depth):
        axes.set_axis_off()
    path.plot(1e3 * tool[:, 2], color=GREY)
    path.plot(1e3 * tool[: k + 1, 2], color=BLUE)
    path.plot(k, 1e3 * tool[k, 2], "o", color=ORANGE)
    path.set_title("height of the tool [mm]", fontsize=8)
    bars.barh(range(len(ACTIONS)), step.action, color=BLUE)
    bars.set_yticks(range(len(ACTIONS)), ACTIONS)
    bars.set_xlim(-1, 1)
    bars.set_title(f"action; fingers {1e3 * step.opening_m:.0f} mm", fontsize=8)
    for axes in (path, bars):
        axes.tick_params(labelsize=7)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
