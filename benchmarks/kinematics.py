"""Inverse kinematics: ``python -m benchmarks.kinematics``.

Prints JSON rows: success and time for random reachable poses of every arm. Peers: for a UR5 the closed form of
``ur-analytic-ik`` by itself; for the others the usual loop over one pose at a time with Pinocchio.
"""

from __future__ import annotations

import argparse

import numpy as np
import pinocchio as pin
from ur_analytic_ik import ur5

from benchmarks._arms import ROBOTS, Array, kinematics, postures
from benchmarks._common import median_ms, print_row
from tr_grasp.motion import Kinematics, inverse_kinematics

GRASPS_N = 100


def one_by_one(arm: Kinematics, T: Array, rng: np.random.Generator, restarts: int = 10) -> Array:
    """Damped least squares with Pinocchio, one pose and one start at a time; NaN where all starts fail."""
    data, frame = arm.model.createData(), arm.model.getFrameId(arm.spec.tcp_link)
    found = np.full((len(T), arm.dof), np.nan)
    for i, goal in enumerate(T):
        for q in [arm.home_q_rad, *postures(arm, restarts, rng)]:
            for _ in range(100):
                pin.framesForwardKinematics(arm.model, data, q)
                error = pin.log6(data.oMf[frame].actInv(pin.SE3(goal))).vector
                if np.abs(error).max() < 1e-5:
                    found[i] = q
                    break
                J = pin.computeFrameJacobian(arm.model, data, q, frame, pin.ReferenceFrame.LOCAL)
                q = np.clip(q + J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error), arm.lower_rad, arm.upper_rad)
            if np.isfinite(found[i]).all():
                break
    return found


def row(name: str, poses_n: int, repeats: int, peer_n: int) -> None:
    """Success for all poses; time for a set of grasps and for one pose after the one before."""
    arm, rng = kinematics(name), np.random.default_rng(1)
    q = postures(arm, poses_n, rng)
    T = arm.pose(q)
    found = inverse_kinematics(arm, T).found
    grasps, near = T[:GRASPS_N], np.clip(q[0] + 0.05, arm.lower_rad, arm.upper_rad)
    calls = [
        lambda: inverse_kinematics(arm, grasps),
        lambda: inverse_kinematics(arm, T),
        lambda: inverse_kinematics(arm, T[0], near),
    ]
    if name.startswith("ur5"):
        peer = "ur-analytic-ik, a loop"
        calls.append(lambda: [ur5.inverse_kinematics(pose) for pose in grasps])
        hundred, thousand, next_one, peer_ms = median_ms(*calls, repeats=repeats)
        peer_success = None
    else:
        peer = f"Pinocchio, a loop with 10 restarts, {peer_n} poses"
        hundred, thousand, next_one = median_ms(*calls, repeats=repeats)
        reached: list[Array] = []
        (peer_ms,) = median_ms(lambda: reached.append(one_by_one(arm, T[:peer_n], rng)), repeats=1)
        peer_ms *= GRASPS_N / peer_n
        peer_success = float(np.isfinite(reached[-1]).all(1).mean())
    print_row(
        f"inverse kinematics, {name}, {GRASPS_N} poses",
        hundred,
        peer,
        peer_ms,
        poses=poses_n,
        success=float(found.mean()),
        peer_success=peer_success,
        ms_per_pose_of_all=round(thousand / poses_n, 4),
        ms_next_pose=round(next_one, 3),
    )


def main(args: list[str] | None = None) -> None:
    """Print all rows."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=1000)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--peer-poses", type=int, default=50)
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=ROBOTS)
    given = parser.parse_args(args)
    for name in given.robots:
        row(name, given.poses, given.repeats, given.peer_poses)


if __name__ == "__main__":
    main()
