"""A method for slow, level paths: wait above a point, go down, close, lift; every sound world lets it succeed."""

from __future__ import annotations

import numpy as np

from tr_grasp.dynamic import GraspOutcome, MethodResult, Phase
from tr_grasp.hardware import finish
from tr_grasp.motion import JointState, Kinematics, inverse_kinematics, point_to_point

DOWN = 0.5
"""Cosine to the vertical of the approaches that it tries."""
WAIT_S, GO_DOWN_S, CLOSE_S, BACK_M = 4.0, 1.0, 0.5, 0.12


class Patient:
    """It looks twice, assumes a straight line, and aims at where the object is when the fingers meet."""

    name = "patient"

    def __init__(self, lift: bool = True) -> None:
        self.lift = lift

    def run(self, station, task):
        arm, world = station.arm, station.world
        kinematics = Kinematics(task.robot)

        def go(T, slower=1.0):
            q = inverse_kinematics(kinematics, T, reference_q=arm.commanded().q).q_rad
            move = point_to_point(arm.commanded(), JointState.at_rest(q), arm.limits).trajectory
            assert finish(arm.move(move.slower(slower)), world).succeeded
            return q

        world.wait(0.2)
        first, last = world.poses(task.target)[0], world.poses(task.target)[-1]
        velocity = (last.T_base_object - first.T_base_object)[:3, 3] / (last.stamp_s - first.stamp_s)
        meet_s = WAIT_S + GO_DOWN_S + CLOSE_S
        T_base_obj = last.T_base_object.copy()
        T_base_obj[:3, 3] += velocity * (meet_s - last.stamp_s)
        tools = T_base_obj @ task.grasps.grasps.poses()
        back = tools.copy()
        back[:, :3, 3] -= BACK_M * tools[:, :3, 2]
        found = [inverse_kinematics(kinematics, T).found for T in (tools, back)]
        good = (tools[:, 2, 2] < -DOWN) & found[0] & found[1]
        if not good.any():
            return MethodResult(GraspOutcome.UNREACHABLE)
        T, above = (poses[np.flatnonzero(good)[0]] for poses in (tools, back))
        go(above)
        world.wait(WAIT_S - world.now_s)
        task.tell(Phase.APPROACHING)
        go(T, slower=2.0)
        task.tell(Phase.CLOSING)
        closed = finish(station.gripper.move(0.0), world)
        task.tell(Phase.LIFTING)
        if self.lift:
            T[2, 3] += task.lift_m
            go(T, slower=2.0)
        task.tell(Phase.HOLDING)
        return MethodResult(GraspOutcome.LIFTED, closed.reason, loops=1, notes={"looks": 2.0})
