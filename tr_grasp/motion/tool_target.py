"""A moving tool pose as a joint target, for the servo."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from tr_grasp.motion.arguments import joint_vector, transforms
from tr_grasp.motion.inverse_kinematics import IKCfg, inverse_kinematics
from tr_grasp.motion.kinematics import Kinematics
from tr_grasp.motion.least_squares import damped_step
from tr_grasp.motion.trajectory import JointState

_NEAR = IKCfg(rounds_n=0)


def tool_target(
    kinematics: Kinematics, T_base_tcp: ArrayLike, velocity: ArrayLike, near_q: ArrayLike
) -> JointState | None:
    """Joints and joint speeds at which the tool is at a pose (4, 4) and moves with it.

    Args:
        kinematics: The arm.
        T_base_tcp: The pose now.
        velocity: (6,) linear [m/s] over angular [rad/s], in base axes.
        near_q: (dof,) the target before this one; no other posture is looked for.

    Returns:
        Nothing where the posture does not reach the pose.

    Raises:
        MotionError: NaN, another number of joints, or a pose that is not rigid.
    """
    q = inverse_kinematics(kinematics, transforms("T_base_tcp", T_base_tcp), near_q, _NEAR).q_rad
    if not np.isfinite(q).all():
        return None
    speed = joint_vector("velocity", velocity, 6)
    # The damped step is linear in a small error: of a microsecond's way it is the speed, and near singularities less.
    step = damped_step(kinematics.jacobian(q)[None], speed[None] * 1e-6)[0]
    return JointState(q, step * 1e6, np.zeros_like(q))
