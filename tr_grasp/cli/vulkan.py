"""Flags that need a Vulkan device; a module of its own, for only some verbs ask the machine."""

from __future__ import annotations

from tr_grasp.doctor import probe_vulkan
from tr_grasp.errors import ConfigError


def require_vulkan(flag: str, otherwise: str) -> None:
    """Refuse a flag that draws with SAPIEN where SAPIEN cannot draw.

    Args:
        flag: As it is given.
        otherwise: The flag that needs no such device.

    Raises:
        ConfigError: There is no Vulkan device.
    """
    device, error = probe_vulkan()
    if not device:
        raise ConfigError(f"{flag} needs a Vulkan device ({error}); {otherwise} needs none.")
