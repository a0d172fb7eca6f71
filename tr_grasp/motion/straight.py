"""The two straight ways: of the joints, and of the tool."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from tr_grasp.motion.arguments import Array
from tr_grasp.motion.collision import CollisionModel
from tr_grasp.motion.edges import points_of
from tr_grasp.motion.inverse_kinematics import IKCfg, inverse_kinematics
from tr_grasp.motion.joint_turns import distance
from tr_grasp.motion.kinematics import Kinematics
from tr_grasp.motion.outcome import Outcome
from tr_grasp.motion.plan import How, Plan, PlannerCfg

# Only from the waypoint before: another posture would be a jump anyway.
_NEXT_TO = IKCfg(rounds_n=0)


def joint_line(model: CollisionModel, start: Array, goal: Array, cfg: PlannerCfg, time_s: float = 0.0) -> Plan:
    """The straight line in joint space, or ``BLOCKED``."""
    return _checked(model, np.stack([start, goal]), cfg, time_s, "joint")


def tool_line(model: CollisionModel, start: Array, T_base_goal: Array, cfg: PlannerCfg, time_s: float = 0.0) -> Plan:
    """The straight line of the tool, turning evenly, or ``UNREACHABLE``, ``JUMP`` or ``BLOCKED``."""
    arm = model.kinematics
    path = [start]
    poses = tool_poses(arm.pose(start), T_base_goal, cfg)
    for i, T in enumerate(poses):
        q = inverse_kinematics(arm, T, path[-1], _NEXT_TO).q_rad
        if not np.isfinite(q).all():
            return _lost(arm, T, path[-1], i, len(poses))
        if (jump := float(distance(q, path[-1]))) > cfg.jump_rad:
            detail = f"{jump:.2f} rad between poses {i} and {i + 1} of {len(poses)}; {cfg.jump_rad:g} rad is allowed"
            return Plan(Outcome.JUMP, detail=detail)
        path.append(q)
    return _checked(model, np.array(path), cfg, time_s, "cartesian")


def tool_poses(T_start: Array, T_goal: Array, cfg: PlannerCfg) -> Array:
    """``T_base_tcp`` (n, 4, 4) on the line to a goal, the goal last, the start left out."""
    turn = pin.log3(T_start[:3, :3].T @ T_goal[:3, :3])
    way = T_goal[:3, 3] - T_start[:3, 3]
    n = max(np.linalg.norm(way) / cfg.cartesian_step_m, np.linalg.norm(turn) / cfg.cartesian_turn_rad)
    shares = np.linspace(0.0, 1.0, max(1, int(np.ceil(n - 1e-9))) + 1)[1:]
    T = np.broadcast_to(T_goal, (len(shares), 4, 4)).copy()
    T[:, :3, 3] = T_start[:3, 3] + shares[:, None] * way
    T[:, :3, :3] = [T_start[:3, :3] @ pin.exp3(share * turn) for share in shares]
    T[-1] = T_goal
    return T


def _lost(arm: Kinematics, T: Array, q: Array, i: int, n: int) -> Plan:
    # A 7-joint arm is only searched near the waypoint before; elsewhere it may well have a posture.
    outcome = Outcome.JUMP if inverse_kinematics(arm, T, q).found else Outcome.UNREACHABLE
    return Plan(outcome, detail=f"pose {i + 1} of {n} on the line")


def _checked(model: CollisionModel, path: Array, cfg: PlannerCfg, time_s: float, how: How) -> Plan:
    if model.all_free(points_of(path, cfg.resolution_rad), time_s):
        return Plan(Outcome.OK, path, how)
    points = points_of(path, cfg.resolution_rad)
    blocked = points[int(np.argmin(model.free(points, time_s)))]
    return Plan(Outcome.BLOCKED, detail=str(model.contact(blocked, time_s) or "two bodies all but touch"))
