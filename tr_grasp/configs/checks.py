"""What a setting must satisfy."""

from __future__ import annotations

from tr_grasp.errors import ConfigError


def require(condition: bool, message: str) -> None:
    """Raise ConfigError with this message unless the condition holds."""
    if not condition:
        raise ConfigError(message)


def require_range(name: str, range_: tuple[float, float], *, at_least: float | None = None) -> None:
    """Raise ConfigError unless a range rises, or is a single value, and starts no lower than ``at_least``."""
    low, high = range_
    bound = "" if at_least is None else f"{at_least:g} <= "
    floor = low if at_least is None else at_least
    require(floor <= low <= high, f"{name} must be {bound}low <= high, got {range_}")
