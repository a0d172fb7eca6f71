"""Stations by name: real devices are opened here, simulated ones by whoever registers them.

    from tr_grasp.hardware.devices import open_station

    with open_station("ur5", "rg2", "realsense", arm_host="192.168.0.10") as station:
        station.arm.state()

Nothing of a maker's package is imported before one of its devices is opened. Put a
:class:`~tr_grasp.hardware.guard.Guard` before the station before anything moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from importlib import import_module
from typing import Any, Protocol

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.hardware.fake import KinematicFake
from tr_grasp.hardware.protocols import Station
from tr_grasp.hardware.real_world import RealWorld
from tr_grasp.robots.spec import RobotSpec, robot_spec

ADAPTERS = "tr_grasp.hardware.adapters"
YES = ("y", "yes")


@dataclass(frozen=True)
class Device:
    """An adapter: its module, the class of its settings, and what opens it."""

    module: str
    settings: str
    opener: str

    def cfg_class(self) -> Any:
        """Class of its settings."""
        return getattr(import_module(f"{ADAPTERS}.{self.module}"), self.settings)

    def open(self, *arguments: Any) -> Any:
        """Open it."""
        return getattr(import_module(f"{ADAPTERS}.{self.module}"), self.opener)(*arguments)


ARMS = {
    "ur5": Device("ur", "UrCfg", "open_arm"),
    "j2s7s300": Device("kinova", "KinovaCfg", "open_arm"),
    "panda": Device("panda", "PandaCfg", "open_arm"),
}
GRIPPERS = {
    "rg2": Device("rg2", "Rg2Cfg", "open_gripper"),
    "robotiq_2f85": Device("robotiq", "RobotiqCfg", "open_gripper"),
    "kg3": Device("kg3", "KinovaCfg", "open_gripper"),
    "panda_hand": Device("panda_hand", "PandaHandCfg", "open_gripper"),
}
CAMERAS = {"realsense": Device("realsense", "RealSenseCfg", "RealSense")}
ROBOTS = {
    ("ur5", "rg2"): "ur5_rg2",
    ("ur5", "robotiq_2f85"): "ur5_robotiq_2f85",
    ("j2s7s300", "kg3"): "j2s7s300",
    ("panda", "panda_hand"): "panda",
}
"""Robots by arm and gripper; the first gripper of an arm is taken if none is named."""


class StationFactory(Protocol):
    """Opens a whole station."""

    def __call__(self, gripper: str | None, camera: str | None, **settings: Any) -> Station:
        """Open it; names and settings are the factory's own."""
        ...


_STATIONS: dict[str, StationFactory] = {}


@dataclass(frozen=True)
class DeviceStation(Station):
    """A station of real devices; closing it halts the arm and lets go of everything."""

    def close(self) -> None:
        """Halt and let go."""
        if isinstance(self.world, RealWorld):
            self.world.close()

    def __enter__(self) -> DeviceStation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def register_station(name: str, factory: StationFactory) -> None:
    """Let :func:`open_station` open a station that has no devices, such as a simulation, as the arm ``name``."""
    _STATIONS[name] = factory


def is_device(arm: str) -> bool:
    """Whether something real moves under this name."""
    return arm not in _STATIONS


def robot_of(arm: str, gripper: str | None = None) -> RobotSpec:
    """The robot that an arm and a gripper make.

    Args:
        arm: An arm of :data:`ARMS`, or the name of a robot such as ``ur5_rg2``.
        gripper: One of :data:`GRIPPERS`; the arm's usual one, if not given.

    Raises:
        ConfigError: No such arm or gripper, or they do not go together.
    """
    return robot_spec(ROBOTS[_pair(arm, gripper)])


def open_station(arm: str, gripper: str | None = None, camera: str | None = None, **settings: Any) -> Station:
    """Open devices that work together.

    Args:
        arm: One of :data:`ARMS`, a robot that has one, such as ``ur5_rg2``, or a registered station, such as ``sim``.
        gripper: One of :data:`GRIPPERS`; the arm's usual one, if not given.
        camera: One of :data:`CAMERAS`, if there is one.
        settings: Fields of the devices' settings with ``arm_``, ``gripper_`` or ``camera_`` before them, such as
            ``arm_host``; text is turned into numbers where they are. The gripper's host is the arm's, if not given; of
            a hand behind the arm's own bridge all others are, too.

    Returns:
        The station, a :class:`DeviceStation` if it is real; no guard is before it yet.

    Raises:
        ConfigError: A name or setting that does not exist or does not fit.
        HardwareError: A device is missing, not connected or not ready, or its package is not installed.
    """
    if arm in _STATIONS:
        return _STATIONS[arm](gripper, camera, **settings)
    pair = _pair(arm, gripper)
    spec = robot_spec(ROBOTS[pair])
    if camera is not None and camera not in CAMERAS:
        raise ConfigError(unknown_name("camera", camera, CAMERAS))
    settings = dict(settings)
    # Arm and hand behind one bridge have all settings in common; others at least stand at one address.
    one_bridge = ARMS[pair[0]].settings == GRIPPERS[pair[1]].settings
    for name in [name for name in settings if name.startswith("arm_") and (one_bridge or name == "arm_host")]:
        settings.setdefault(name.replace("arm_", "gripper_", 1), settings[name])
    arm_cfg = _cfg(ARMS[pair[0]], "arm", settings)
    gripper_cfg = _cfg(GRIPPERS[pair[1]], "gripper", settings)
    camera_cfg = _cfg(CAMERAS[camera], "camera", settings) if camera else None
    if settings:
        raise ConfigError(f"unknown setting {sorted(settings)[0]!r}: its name starts with arm_, gripper_ or camera_.")
    world = RealWorld()
    try:
        seen = _kept(world, CAMERAS[camera].open(camera_cfg, world)) if camera else None
        fingers = _kept(world, GRIPPERS[pair[1]].open(spec.gripper, gripper_cfg, world))
        return DeviceStation(_kept(world, ARMS[pair[0]].open(spec, arm_cfg, world)), fingers, world, seen)
    except BaseException:
        world.close()
        raise


def rehearsal(arm: str, gripper: str | None = None) -> Station:
    """The same robot without devices, in virtual time: for the dry run before anything real moves.

    Raises:
        ConfigError: See :func:`robot_of`.
    """
    return KinematicFake.of(robot_of(arm, gripper))


def confirm(
    arm: str, gripper: str | None, rehearse: Callable[[Station], str], ask: Callable[[str], str] = input
) -> bool:
    """Whether a run on a device may start: it is rehearsed without the device, and a person says yes to the outcome.

    Args:
        arm: As for :func:`open_station`; where nothing real moves, nobody is asked.
        gripper: As there.
        rehearse: Does the run on a station without devices, raises what is wrong with it, and sums it up for people.
        ask: Shows a question and returns the answer.
    """
    if not is_device(arm):
        return True
    summary = rehearse(rehearsal(arm, gripper))
    question = (
        f"Dry run: {summary}\nThe real {robot_of(arm, gripper).name} will move now. Is the way clear, and the "
        "emergency stop in reach? [y/N] "
    )
    try:
        return ask(question).strip().lower() in YES
    except EOFError:  # nobody is there
        return False


def _pair(arm: str, gripper: str | None) -> tuple[str, str]:
    pairs = {robot: pair for pair, robot in ROBOTS.items()}
    if arm in pairs and gripper in (None, pairs[arm][1]):
        return pairs[arm]
    if arm not in ARMS:
        known = [*ARMS, *pairs, *_STATIONS]
        raise ConfigError(unknown_name("arm", arm, known) if arm not in pairs else f"{arm} has no {gripper}.")
    if gripper is not None and gripper not in GRIPPERS:
        raise ConfigError(unknown_name("gripper", gripper, GRIPPERS))
    fitting = [own for holder, own in ROBOTS if holder == arm]
    if gripper is not None and gripper not in fitting:
        raise ConfigError(f"the arm {arm!r} has no gripper {gripper!r}; valid: {', '.join(fitting)}.")
    return arm, gripper or fitting[0]


def _kept(world: RealWorld, device: Any) -> Any:
    world.at_close(device.close)
    return device


def _cfg(device: Device, role: str, settings: dict[str, Any]) -> Any:
    """Settings of one device, taken out of all."""
    kind = device.cfg_class()
    known = {field.name: field for field in fields(kind)}
    own = {key.removeprefix(f"{role}_"): settings.pop(key) for key in list(settings) if key.startswith(f"{role}_")}
    if unknown := sorted(set(own) - set(known)):
        raise ConfigError(unknown_name(f"setting of the {role}", unknown[0], known))
    missing = [name for name, field in known.items() if field.default is MISSING and name not in own]
    if missing:
        raise ConfigError(f"{role}_{missing[0]} must be given: the {role} has no default for it.")
    return kind(**{name: _typed(f"{role}_{name}", str(known[name].type), value) for name, value in own.items()})


def _typed(name: str, kind: str, value: Any) -> Any:
    if kind not in ("int", "float") or not isinstance(value, str):
        return value
    try:
        return int(value) if kind == "int" else float(value)
    except ValueError as error:
        raise ConfigError(f"{name} must be a number, got {value!r}.") from error
