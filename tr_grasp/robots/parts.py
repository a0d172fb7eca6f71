"""What a robot is made of, as plain data: shapes, links, joints, fingers. Metres, kilograms, radians; no simulator."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Vector = tuple[float, float, float]
Inertia = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Shape:
    """A solid fixed to a link.

    Attributes:
        kind: ``box``, ``cylinder`` (along its z), ``sphere`` or ``mesh``.
        size_m: Box: edges; cylinder: (radius, length); sphere: (radius,); mesh: its scale along x, y, z.
        xyz_m, rpy_rad: Pose in the link's frame, as in URDF.
        colour: Red, green, blue in [0, 1].
        collides: Bodies bump into it.
        drawn: It is seen.
        mesh: File of a ``mesh``.
    """

    kind: Literal["box", "cylinder", "sphere", "mesh"]
    size_m: tuple[float, ...]
    xyz_m: Vector = (0.0, 0.0, 0.0)
    rpy_rad: Vector = (0.0, 0.0, 0.0)
    colour: Vector = (0.7, 0.7, 0.72)
    collides: bool = True
    drawn: bool = True
    mesh: Path | None = None


@dataclass(frozen=True)
class LinkSpec:
    """A rigid body; without mass it is only a frame.

    Attributes:
        name: Its name in the URDF.
        mass_kg: Mass.
        com_m: (3,) centre of mass in the link's frame.
        inertia_kgm2: (ixx, iyy, izz, ixy, ixz, iyz) about the centre of mass.
        shapes: What it looks like and bumps into.
        com_rpy_rad: Axes of the inertia in the link's frame.
    """

    name: str
    mass_kg: float = 0.0
    com_m: Vector = (0.0, 0.0, 0.0)
    inertia_kgm2: Inertia = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    shapes: tuple[Shape, ...] = ()
    com_rpy_rad: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class JointSpec:
    """How a link moves against its parent.

    Units are radians and newton metres for ``revolute`` and ``continuous`` joints, metres and newtons for
    ``prismatic`` ones; a ``fixed`` joint has no limits.

    Attributes:
        name, parent, child: Names in the URDF.
        kind: Its type in the URDF.
        xyz_m, rpy_rad: Pose of the child's frame in the parent's at position 0.
        axis: Unit vector in the child's frame.
        lower, upper: Positions; two turns either way for ``continuous``.
        velocity, acceleration, jerk, effort: Limits of its motion and force.
    """

    name: str
    parent: str
    child: str
    kind: Literal["revolute", "continuous", "prismatic", "fixed"] = "revolute"
    xyz_m: Vector = (0.0, 0.0, 0.0)
    rpy_rad: Vector = (0.0, 0.0, 0.0)
    axis: Vector = (0.0, 0.0, 1.0)
    lower: float = 0.0
    upper: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0
    effort: float = 0.0


@dataclass(frozen=True)
class FingerSpec:
    """One finger: a joint that is driven and joints that its linkage moves along with it.

    Between closed and open all joints move in proportion.

    Attributes:
        joints: The driven one first.
        closed, open: Position of each joint when the gripper is closed and open.
        links: Links whose touch counts as this finger's.
        pad_link, pad_point_m: Centre of the surface that grips, in the frame of a link.
        tip_point_m: The finger's end, in the same frame.
        share: Part of the gripping force that this finger bears, 1 for one that opposes all others.
    """

    joints: tuple[JointSpec, ...]
    closed: tuple[float, ...]
    open: tuple[float, ...]
    links: tuple[str, ...]
    pad_link: str
    pad_point_m: Vector = (0.0, 0.0, 0.0)
    tip_point_m: Vector = (0.0, 0.0, 0.0)
    share: float = 1.0


@dataclass(frozen=True)
class GripperSpec:
    """Fingers that open and close together; nothing in the URDF couples them, the controller does.

    Attributes:
        fingers: Two or more.
        openings_m: Distance between the pads at evenly spaced positions from closed (all joints at
            :attr:`FingerSpec.closed`) to open; ascending.
        tips_m: How far the fingertips reach beyond the tcp, along its z, at the same positions.
        speed_mps: How fast the opening changes.
        speed_range_mps: What the maker allows.
        force_n: With what force it grips.
        force_range_n: What the maker allows.
        stiffness: Gain of the driven joints [N/m or N m/rad].
    """

    fingers: tuple[FingerSpec, ...]
    openings_m: tuple[float, ...]
    tips_m: tuple[float, ...]
    speed_mps: float
    speed_range_mps: tuple[float, float]
    force_n: float
    force_range_n: tuple[float, float]
    stiffness: float

    @property
    def joints(self) -> tuple[JointSpec, ...]:
        """All finger joints, finger by finger."""
        return tuple(joint for finger in self.fingers for joint in finger.joints)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of :attr:`joints`."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def closed(self) -> Array:
        """(joints,) positions when closed."""
        return np.array([q for finger in self.fingers for q in finger.closed])

    @cached_property
    def open(self) -> Array:
        """(joints,) positions when open."""
        return np.array([q for finger in self.fingers for q in finger.open])

    @property
    def opening_range_m(self) -> tuple[float, float]:
        """Smallest and largest distance between the pads."""
        return self.openings_m[0], self.openings_m[-1]

    def openness(self, opening_m: float) -> float:
        """Way from closed (0) to open (1) at which the pads are this far apart; clipped to the range."""
        return float(np.interp(opening_m, self._openings, self._openness))

    def joint_positions(self, opening_m: float) -> Array:
        """(joints,) at which the pads are this far apart; clipped to the range."""
        return self.closed + self.openness(opening_m) * (self.open - self.closed)

    def opening_m(self, positions: Array) -> float:
        """Distance between the pads at joint positions (joints,); fingers that disagree are averaged."""
        return self.opening_at(float(self.finger_openness(positions).mean()))

    def opening_at(self, openness: float) -> float:
        """Distance between the pads at a way from closed (0) to open (1)."""
        return float(np.interp(openness, self._openness, self._openings))

    def tips_at(self, openness: float) -> float:
        """How far the fingertips reach beyond the tcp, at a way from closed (0) to open (1)."""
        return float(np.interp(openness, self._openness, self._tips))

    def tips_beyond_tcp_m(self, opening_m: float) -> float:
        """How far the fingertips reach beyond the tcp, along its z; linkages retract them as they open."""
        return self.tips_at(self.openness(opening_m))

    def finger_openness(self, positions: Array) -> Array:
        """(fingers,) how far the driven joint of each finger is from closed (0) to open (1)."""
        lead = self.lead
        return (np.asarray(positions)[lead] - self.closed[lead]) / (self.open - self.closed)[lead]

    @cached_property
    def lead(self) -> NDArray[np.integer]:
        """(fingers,) which of :attr:`joints` are driven."""
        return np.cumsum([0] + [len(finger.joints) for finger in self.fingers[:-1]])

    @cached_property
    def finger_of_joint(self) -> NDArray[np.integer]:
        """(joints,) which finger each of :attr:`joints` belongs to."""
        return np.repeat(np.arange(len(self.fingers)), [len(finger.joints) for finger in self.fingers])

    @cached_property
    def _openness(self) -> Array:
        return np.linspace(0.0, 1.0, len(self.openings_m))

    @cached_property
    def _openings(self) -> Array:
        return np.array(self.openings_m)

    @cached_property
    def _tips(self) -> Array:
        return np.array(self.tips_m)


@dataclass(frozen=True)
class DhRow:
    """One row of classic Denavit-Hartenberg parameters.

    The pose of a frame in the one before it is Rz(q + ``offset_rad``) Tz(``d_m``) Tx(``a_m``) Rx(``alpha_rad``).
    """

    a_m: float
    d_m: float
    alpha_rad: float
    offset_rad: float = 0.0


@dataclass(frozen=True)
class DhTable:
    """Published kinematics of an arm, to check ours against.

    Attributes:
        rows: One for each joint.
        link: Link of the URDF that the last row ends at.
        base_rpy_rad: Turn from the URDF's base link to the first row's frame, as in URDF.
        source: Where the numbers are published.
    """

    rows: tuple[DhRow, ...]
    link: str
    base_rpy_rad: Vector
    source: str
