"""Which controller executes the steps of a task."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from tr_grasp.configs import EnvCfg
from tr_grasp.envs.latency import LateControllerConfig
from tr_grasp.robots.agents import CartesianControllerConfig


def controller_config(cfg: EnvCfg, robot: str) -> Callable[..., CartesianControllerConfig]:
    """What makes the settings of the task's controller.

    Args:
        cfg: The task.
        robot: Name or YAML file.
    """
    if cfg.action.execution == "planned":
        # Planning loads libraries that nothing else in Task I needs.
        from tr_grasp.envs.planned_controller import PlannedControllerConfig

        return partial(PlannedControllerConfig, robot=robot)
    return LateControllerConfig if cfg.randomise.latency else CartesianControllerConfig
