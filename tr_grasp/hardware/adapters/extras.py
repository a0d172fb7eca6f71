"""Packages of device makers: asked for when a device is opened, and named when they are missing."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from tr_grasp.errors import HardwareError


def maker_package(module: str, extra: str, device: str) -> ModuleType:
    """A package that drives a device.

    Raises:
        HardwareError: It is not installed, or a library that it needs is not.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        raise HardwareError(
            f"{device} needs the package {error.name or module}: pip install 'tr-grasp[{extra}]'."
        ) from error
    except ImportError as error:
        raise HardwareError(f"{device} needs the package {module}, which does not load: {error}.") from error
