"""How a motion looks: joints over time against their limits, and the arm as a stick figure."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from tr_grasp.errors import MotionError
from tr_grasp.files import write_atomically
from tr_grasp.motion.arguments import Array, positive
from tr_grasp.motion.kinematics import Kinematics
from tr_grasp.motion.limits import MotionLimits
from tr_grasp.motion.trajectory import Trajectory

COLOURS = ("#3b6fd4", "#d98324", "#2f9e66", "#d2584e", "#7d57c1", "#2b9aa0", "#8a6d3b")
TEXT, MUTED = "#1c2534", "#9aa5b5"
TRAIL_PER_FRAME = 8
PLANNED, EXECUTED = "#9aa5b5", "#d98324"


def plot_trajectory(
    trajectory: Trajectory,
    limits: MotionLimits,
    path: str | Path,
    *,
    executed: tuple[Array, Array] | None = None,
    joint_names: Sequence[str] = (),
) -> Path:
    """Write a PNG: position, speed and acceleration of every joint, each as a part of its limit.

    Args:
        trajectory: What was planned; solid lines.
        limits: Dashed lines at ±1. Positions are drawn from the middle of their range.
        path: Ends in ``.png``; its folder exists.
        executed: Times (n,) and positions (n, dof) that were measured; dotted lines.
        joint_names: For the legend.

    Raises:
        MotionError: Another ending, or limits of another number of joints.
        StorageError: It could not be written.
    """
    path = _ending(path, ".png")
    if limits.dof != trajectory.dof:
        raise MotionError(f"limits must be for the {trajectory.dof} joints of the trajectory, got {limits.dof}.")
    # More samples than pixels, and the knots, where acceleration switches.
    times = np.union1d(np.linspace(0.0, trajectory.duration_s, 600), trajectory.times_s)
    state = trajectory.sample(times)
    middle, half = (limits.lower_rad + limits.upper_rad) / 2, (limits.upper_rad - limits.lower_rad) / 2
    rows = {
        "position": (state.q - middle) / half,
        "speed": state.dq / limits.velocity_rad_s,
        "acceleration": state.ddq / limits.acceleration_rad_s2,
    }
    figure = Figure(figsize=(8.0, 7.2), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(3, 1, sharex=True)
    for axis, (name, values) in zip(axes, rows.items(), strict=True):
        _draw_shares(axis, times, values, name, joint_names)
    if executed is not None:
        for j in range(trajectory.dof):
            axes[0].plot(executed[0], (executed[1][:, j] - middle[j]) / half[j], ":", color=_colour(j), lw=2.2)
    axes[-1].set_xlabel("time [s]", color=TEXT)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    stream = io.BytesIO()
    figure.savefig(stream, dpi=130, format="png")
    write_atomically(path, stream.getvalue())
    return path


def save_replay(
    kinematics: Kinematics,
    trajectory: Trajectory,
    path: str | Path,
    *,
    executed: tuple[Array, Array] | None = None,
    boxes: Sequence[tuple[Array, Array]] = (),
    frame_s: float = 0.1,
) -> Path:
    """Write a GIF: the arm as a stick figure with the planned way of its tool, and the measured arm beside it.

    Args:
        kinematics: The arm.
        trajectory: What was planned; grey.
        path: Ends in ``.gif``; its folder exists.
        executed: Times (n,) and positions (n, dof) that were measured; orange. The planned motion, if not given.
        boxes: Edges (3,) and ``T_base_box`` (4, 4) of obstacles.
        frame_s: Time between pictures; a replay is in real time.

    Raises:
        MotionError: Another ending, or a time that is not positive.
        StorageError: It could not be written.
    """
    path = _ending(path, ".gif")
    times = np.append(np.arange(0.0, trajectory.duration_s, positive("frame_s", frame_s)), trajectory.duration_s)
    planned = trajectory.sample(times).q
    measured = planned if executed is None else _at(executed, times)
    line = kinematics.pose(trajectory.sample(np.linspace(0.0, trajectory.duration_s, 200)).q)[:, :3, 3]
    fine = np.interp(np.arange((len(times) - 1) * TRAIL_PER_FRAME + 1) / TRAIL_PER_FRAME, np.arange(len(times)), times)
    trail = kinematics.pose(trajectory.sample(fine).q if executed is None else _at(executed, fine))[:, :3, 3]
    figure = Figure(figsize=(5.2, 5.2))
    figure.subplots_adjust(0.0, 0.02, 0.95, 0.97)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    figures = [tuple(map(kinematics.joint_positions, pair)) for pair in zip(planned, measured, strict=True)]
    reach = np.vstack([points for pair in figures for points in pair])
    pictures = []
    for i, (plan, real) in enumerate(figures):
        axes.clear()
        _stage(axes, reach, boxes)
        axes.plot(*line.T, color=PLANNED, lw=1.2)
        axes.plot(*trail[: i * TRAIL_PER_FRAME + 1].T, color=EXECUTED, lw=1.6)
        axes.plot(*plan.T, "-o", color=PLANNED, lw=5, ms=5, alpha=0.6)
        axes.plot(*real.T, "-o", color=EXECUTED, lw=2.5, ms=4)
        axes.set_title(f"{times[i]:.1f} s    grey: plan, orange: arm", color=TEXT, fontsize=10)
        canvas.draw()
        pictures.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
    durations = [1000 * frame_s] * (len(pictures) - 1) + [1500]
    write_atomically(path, imageio.imwrite("<bytes>", pictures, extension=".gif", duration=durations, loop=0))
    return path


def _draw_shares(axes: Axes, times: Array, values: Array, name: str, joint_names: Sequence[str]) -> None:
    for j in range(values.shape[1]):
        label = joint_names[j] if j < len(joint_names) else f"joint {j + 1}"
        axes.plot(times, values[:, j], color=_colour(j), lw=1.4, label=label)
    for limit in (-1.0, 1.0):
        axes.axhline(limit, color=TEXT, ls="--", lw=0.9)
    axes.set_ylim(-1.15, 1.15)
    axes.set_xlim(0.0, times[-1])
    axes.set_ylabel(f"{name} / limit", color=TEXT)
    axes.grid(color="#e6eaf0", lw=0.7)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(colors=TEXT)


def _stage(axes: Axes3D, reach: Array, boxes: Sequence[tuple[Array, Array]]) -> None:
    centre, half = (reach.min(0) + reach.max(0)) / 2, max(0.3, float(np.ptp(reach, axis=0).max()) / 2)
    axes.set(xlim=centre[0] + half * np.array([-1, 1]), ylim=centre[1] + half * np.array([-1, 1]))
    axes.set_zlim(max(centre[2] - half, -0.05), centre[2] + half)
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.view_init(elev=22, azim=-58)
    for size, T in boxes:
        # Tables are larger than the picture; only what stands on them is drawn.
        if np.max(size) <= 2 * half:
            _draw_box(axes, np.asarray(size, float), np.asarray(T, float))


def _draw_box(axes: Axes3D, size: Array, T: Array) -> None:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    points = (corners * size) @ T[:3, :3].T + T[:3, 3]
    for i in range(8):
        for j in range(i + 1, 8):
            if np.sum(corners[i] != corners[j]) == 1:
                axes.plot(*points[[i, j]].T, color=MUTED, lw=1.0)


def _at(executed: tuple[Array, Array], times: Array) -> Array:
    return np.stack([np.interp(times, executed[0], column) for column in np.asarray(executed[1]).T], axis=1)


def _colour(joint: int) -> str:
    return COLOURS[joint % len(COLOURS)]


def _ending(path: str | Path, ending: str) -> Path:
    path = Path(path)
    if path.suffix.lower() != ending:
        raise MotionError(f"path must end in {ending}, got {str(path)!r}.")
    return path
