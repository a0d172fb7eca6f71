"""What a guard lets pass."""

from __future__ import annotations

from dataclasses import dataclass

from tr_grasp.errors import ConfigError

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class GuardCfg:
    """Settings of :class:`~tr_grasp.hardware.guard.Guard`.

    Raises:
        ConfigError: A value that makes no sense.
    """

    joint_margin_rad: float = 0.0
    """How far from their limits joints must stay."""

    speed_share: float = 1.0
    """Part of the arm's speed that may be used."""

    jump_rad: float = 0.05
    """How far a set-point may be from what the arm was told before."""

    lag_rad: float = 0.25
    """How far measured joints may be from the commanded ones."""

    workspace_m: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of the box in which the tcp must stay, base frame; anywhere, if not given."""

    effort_share: float = 1.0
    """Part of the arm's torques that may be measured."""

    grip_force_n: float | None = None
    """Strongest grip that may be ordered or measured; the gripper's own, if not given."""

    stale_after_s: float = 0.1
    """States older than this are not relied upon."""

    watchdog_s: float = 0.1
    """A stream of set-points may pause for so long."""

    check_period_s: float = 0.01
    """Time between two checks while time passes."""

    def __post_init__(self) -> None:
        for name in (
            "speed_share", "jump_rad", "lag_rad", "effort_share", "stale_after_s", "watchdog_s", "check_period_s"
        ):  # fmt: skip
            if not getattr(self, name) > 0:
                raise ConfigError(f"guard.{name} must be positive, got {getattr(self, name)}")
        if not self.joint_margin_rad >= 0:
            raise ConfigError(f"guard.joint_margin_rad must not be negative, got {self.joint_margin_rad}")
        if self.workspace_m and not all(a < b for a, b in zip(*self.workspace_m, strict=True)):
            raise ConfigError(f"guard.workspace_m must be a lowest and a highest corner, got {self.workspace_m}")
