"""What every test gets: fixed seeds, one thread, and a skip where the machine lacks what a marker asks for."""

from __future__ import annotations

import os
import random
from collections.abc import Iterable

# Threads are counted when torch is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import pytest
import torch
from hypothesis import settings

from tr_grasp.doctor import probe_vulkan

# The first call into torch takes longer than hypothesis' 200 ms; examples are the same on every run.
settings.register_profile("tr_grasp", deadline=None, derandomize=True, database=None)
settings.load_profile("tr_grasp")

torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def _seeds() -> None:
    random.seed(0)
    np.random.seed(0)  # noqa: NPY002 -- for code of others that uses the global generator
    torch.manual_seed(0)


def pytest_collection_modifyitems(items: Iterable[pytest.Item]) -> None:
    """Skip ``render`` where SAPIEN finds nothing to draw with; asked once, and only if such a test is there."""
    render = [item for item in items if item.get_closest_marker("render")]
    if not render or os.environ.get("TR_GRASP_FORCE_RENDER") == "1":
        return
    device, error = probe_vulkan()
    if not device:
        for item in render:
            item.add_marker(pytest.mark.skip(reason=f"no Vulkan device: {error}"))
