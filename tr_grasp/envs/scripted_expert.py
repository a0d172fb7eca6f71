"""The scripted expert at work: plans on the true scene and remembers the plan while nothing moves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.expert import (
    ToolState,
    choose_grasp,
    expert_action,
    lift_action,
    no_target,
    target_from_tool,
    wait_action,
)
from tr_grasp.grasps import GripperShape, HeightMap, TopDownGrasps, top_down_grasps
from tr_grasp.grasps.top_down import USUAL, Demands

Array = NDArray[np.floating]
Label = tuple[NDArray[np.float32], NDArray[np.float32]]
MOVED = 0.004
"""Change of an entry of a pose matrix (metres, or about radians) from which an object has moved."""
CELL_M, FINE_CELL_M = 0.004, 0.002
GRASPS_PER_OBJECT_N = 64
"""Enough for a whole rim: which of many equal grasps were the best dozen, nobody could see and learn."""
LAST_RESORT = Demands(depth_m=0.005, spare_m=0.003, flatness=0.05, corner_width_m=0.036)
"""Corners of what is wider than the gripper opens, tight fits and low rims: looked for where nothing else is found."""


class ScriptedExpert:
    """Sees the true scene; one for each scene.

    Args:
        cfg: The task.
        look: Measures the scene from above, with cells of the given edge [m].
        gripper: What it grasps with.
    """

    def __init__(self, cfg: EnvCfg, look: Callable[[float], HeightMap], gripper: GripperShape) -> None:
        self._cfg, self._look, self._gripper = cfg, look, gripper
        self._centre_m = np.array(cfg.workspace.centre_m[:2])
        self._planned_for: Array | None = None

    def label(self, tool: ToolState, object_poses: Array) -> Label:
        """What it does in the present state and where it is going.

        Args:
            tool: The gripper.
            object_poses: (objects, 4, 4) ``T_base_object``.

        Returns:
            Action (5,) and target (6,), as in :mod:`tr_grasp.keys`.
        """
        if tool.holding:
            return lift_action(), no_target()
        grasps = self._plan(object_poses)
        best = choose_grasp(grasps, tool, self._centre_m)
        if best is None:
            return wait_action(), no_target()
        grasp = grasps[best]
        return expert_action(tool, grasp, self._cfg.action, self._gripper.opening_m), target_from_tool(tool, grasp)

    def _plan(self, poses: Array) -> TopDownGrasps:
        """Grasps of the present scene, searched anew only if an object has moved since."""
        if self._planned_for is None or np.abs(poses - self._planned_for).max() >= MOVED:
            self._planned_for = poses
            self._grasps = self._found(poses, USUAL, CELL_M)
            if not len(self._grasps):
                self._grasps = self._found(poses, LAST_RESORT, FINE_CELL_M)
        return self._grasps

    def _found(self, poses: Array, demands: Demands, cell_m: float) -> TopDownGrasps:
        w = self._cfg.workspace
        half = w.side_m / 2
        return top_down_grasps(
            self._look(cell_m),
            poses[:, :2, 3],
            gripper=self._gripper,
            demands=demands,
            lowest_tcp_m=w.tcp_height_m[0],
            within_m=(self._centre_m - half, self._centre_m + half),
            per_object_n=GRASPS_PER_OBJECT_N,
        )
