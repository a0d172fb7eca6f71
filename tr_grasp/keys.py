"""Every TensorDict key that crosses a package border, on one page.

Shapes are those of one environment (batch size ``[]``); ``stack`` is the number of stacked
observations, oldest first.
"""

from __future__ import annotations

OCTREE = "octree"
"""``OctreeFrame`` with batch ``(stack,)``: what the depth camera saw, in the robot's base frame."""

PROPRIO = "proprio"
"""float32 ``(stack, 10)``: gripper reading, tcp position [m], first two columns of R_base_tcp."""

COLOUR_IMAGE = "colour_image"
"""uint8 ``(stack, 3, h, w)``: the camera's colour pictures; only with ``observation.image`` on."""

DEPTH_IMAGE = "depth_image"
"""float32 ``(stack, 1, h, w)``: its depth pictures with their noise [m], 0 where nothing was seen; likewise."""

STAGES = "stages"
"""float32 ``(4,)``: which of reach, touch, grasp, lift were reached in this episode (critic only)."""

EXPERT_ACTION = "expert_action"
"""float32 ``(5,)``: what the scripted expert would do now (privileged; only with expert labels on)."""

EXPERT_TARGET = "expert_target"
"""float32 ``(6,)``: the expert's grasp minus the tcp [m] (3), cosine and sine of twice the turn to it, and 1 if there
is one (else zeros); privileged, only with expert labels on."""

OUTCOME = "outcome"
"""int64 ``(1,)``: index into ``envs.Outcome``, as if the episode ended now."""

SUCCESS = "success"
"""bool ``(1,)``: an object is held ``lift_height_m`` up."""

ACTION = "action"
"""float32 ``(5,)`` in [-1, 1]: dx, dy, dz, dphi, gripper (positive opens, negative closes)."""

OPEN, CLOSE = 1.0, -1.0
"""What an expert commands of the gripper, the last component of an action."""

ACTOR_FEATURES = "actor_features"
CRITIC_FEATURES = "critic_features"
