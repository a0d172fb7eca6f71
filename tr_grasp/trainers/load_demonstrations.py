"""Starting a run from recorded demonstrations."""

from __future__ import annotations

from pathlib import Path

from tr_grasp.configs import TrainCfg
from tr_grasp.errors import DemonstrationError
from tr_grasp.trainers.demonstration_file import DemonstrationFile, Recording, require_equal
from tr_grasp.trainers.replay import ReplayBuffer

MUST_MATCH = (
    "env.robot",
    "env.control_hz",
    "env.workspace",
    "env.action",
    "env.observation.depth",
    "env.observation.leaf_capacity",
    "env.observation.colour",
    "env.observation.gripper_reading",
    "env.observation.image",
    "env.reward",
)
"""Settings that decide what a number in a transition means. Objects, camera and the like may differ, and stacks are put
together anew."""


def load_demonstrations(cfg: TrainCfg, buffer: ReplayBuffer) -> DemonstrationFile:
    """Fill a replay with the first ``demonstrations.transitions_n`` transitions of ``demonstrations.file``.

    Raises:
        DemonstrationError: The file is missing, damaged, or of a world in which the run's policy cannot act.
    """
    assert cfg.demonstrations.file is not None
    file = DemonstrationFile(Path(cfg.demonstrations.file))
    require_equal(file, Recording(env=cfg.env), MUST_MATCH, "record anew or change the setting")
    if not len(file):
        raise DemonstrationError(f"'{file.path}' holds no episode; record some with `tr-grasp demos record`.")
    for demonstration in file:
        left = cfg.demonstrations.transitions_n - buffer.written
        if left <= 0:
            break
        buffer.extend(demonstration.chunk(buffer.stack_n)[:left])
    return file
