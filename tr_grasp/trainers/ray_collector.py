"""Collecting in processes that Ray runs, on this machine or on those of a cluster."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tensordict.nn import TensorDictModuleBase
from torchrl.collectors import BaseCollector, Collector
from torchrl.envs import EnvBase

import tr_grasp
from tr_grasp.errors import ConfigError

WORKER_RESOURCES = {"num_cpus": 1, "num_gpus": 0}


def start_ray_collector(
    makers: Sequence[Callable[[], EnvBase]], policy: TensorDictModuleBase, **common: Any
) -> BaseCollector:
    """One TorchRL collector in a process of its own for each maker; whichever is ready hands over its chunk.

    Ray joins the cluster that the variable RAY_ADDRESS names, and starts one on this machine otherwise. Other machines
    need this package installed.

    Args:
        makers: Make the environments, in the workers.
        policy: Acts in all of them; its weights are pushed with ``update_policy_weights_``.
        common: ``frames_per_batch``, ``exploration_type`` and what else a ``Collector`` takes.

    Raises:
        ConfigError: Ray is not installed.
    """
    try:
        import ray  # noqa: F401
    except ImportError:
        raise ConfigError(
            "trainer.collector ray needs the package ray: pip install 'tr-grasp[ray]'; process needs no more."
        ) from None
    from torchrl.collectors.distributed import RayCollector

    frames_per_batch, exploration_type = common.pop("frames_per_batch"), common.pop("exploration_type")
    common.pop("total_frames")
    return RayCollector(
        list(makers),
        policy,
        collector_class=Collector,
        collector_kwargs={"trust_policy": True, **common},
        frames_per_batch=frames_per_batch,
        total_frames=sys.maxsize,  # a Ray collector has no sign for "without end"
        exploration_type=exploration_type,
        sync=False,
        ray_init_config=_ray_settings(len(makers)),
        remote_configs=WORKER_RESOURCES,
    )


def _ray_settings(workers_n: int) -> dict[str, Any]:
    if os.environ.get("RAY_ADDRESS"):
        return {"address": os.environ["RAY_ADDRESS"]}
    # A source tree that is on this process's path alone would be missing in the workers.
    places = [str(Path(tr_grasp.__file__).parents[1]), os.getcwd(), os.environ.get("PYTHONPATH", "")]
    variables = {"PYTHONPATH": os.pathsep.join(filter(None, places)), "OMP_NUM_THREADS": "1"}
    return {"num_cpus": workers_n, "include_dashboard": False, "runtime_env": {"env_vars": variables}}
