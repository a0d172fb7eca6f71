"""Two-finger grippers whose fingertips stay parallel: each finger is one side of a parallelogram.

A crank turns about a pivot on the hand; the fingertip hangs on its end and turns back by the same angle. In the real
grippers a second, parallel bar does that; here it is only drawn and the controller turns the fingertip, which needs
no closed loop in the simulator.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import asin, atan2, cos, hypot, sin

import numpy as np

from tr_grasp.robots.parts import FingerSpec, GripperSpec, Inertia, JointSpec, LinkSpec, Vector
from tr_grasp.robots.solids import block, rod, rod_inertia

TIP_BEYOND_TCP_M = 0.0095
"""The closed fingertips end this far beyond the tcp, as the Panda's do."""
SAMPLES = 65
BLACK: Vector = (0.09, 0.09, 0.10)
DARK: Vector = (0.22, 0.23, 0.25)
STEEL: Vector = (0.62, 0.64, 0.66)
RUBBER: Vector = (0.16, 0.16, 0.17)
PALE: Vector = (0.86, 0.88, 0.89)
ONROBOT_BLUE: Vector = (0.30, 0.62, 0.86)


@dataclass(frozen=True)
class LinkageGripper:
    """Parts of a gripper to be put on an arm."""

    spec: GripperSpec
    links: tuple[LinkSpec, ...]
    fixed_joints: tuple[JointSpec, ...]


@dataclass(frozen=True)
class Linkage:
    """One finger in the plane of the gripper, seen from the hand: y away from the middle, z out of the hand [m].

    Attributes:
        pivot: Of the crank.
        crank_m: From the pivot to the fingertip's joint.
        open_rad: Angle of the open crank from z towards y.
        pad: Centre of the gripping surface from the fingertip's joint.
        tip_m: End of the fingertip from its joint, along z.
    """

    pivot: tuple[float, float]
    crank_m: float
    open_rad: float
    pad: tuple[float, float]
    tip_m: float

    @property
    def closed_rad(self) -> float:
        """Angle at which the pads meet in the middle."""
        return asin((-self.pivot[0] - self.pad[0]) / self.crank_m)

    def opening_m(self, angle_rad: float) -> float:
        """Distance between the two pads."""
        return 2 * (self.pivot[0] + self.crank_m * sin(angle_rad) + self.pad[0])

    def tip_height_m(self, angle_rad: float) -> float:
        """The fingertip's end, from the hand's mounting face."""
        return self.pivot[1] + self.crank_m * cos(angle_rad) + self.tip_m


def rg2(flange: str) -> LinkageGripper:
    """OnRobot RG2: opens 110 mm, 3-40 N, 38-127 mm/s, 0.78 kg, 213 mm long (datasheet).

    Pivots as in public models of it; the crank is as long as the datasheet's stroke and length ask for.
    """
    linkage = Linkage(pivot=(0.01718, 0.1258), crank_m=0.0620, open_rad=1.2141585, pad=(-0.02028, 0.0128), tip_m=0.0253)
    hand = (
        rod((0, 0, 0), (0, 0, 0.022), 0.0345, DARK),
        rod((0, 0, 0.022), (0, 0, 0.026), 0.0345, ONROBOT_BLUE, collides=False),
        block((0.038, 0.064, 0.080), (0, 0, 0.066), PALE),
        rod((-0.0192, 0, 0.060), (0.0192, 0, 0.060), 0.020, DARK, collides=False),
        rod((-0.0196, 0, 0.060), (0.0196, 0, 0.060), 0.015, ONROBOT_BLUE, collides=False),
        block((0.034, 0.052, 0.028), (0, 0, 0.119), DARK),
        rod((-0.019, 0.01718, 0.1258), (0.019, 0.01718, 0.1258), 0.009, STEEL, collides=False),
        rod((-0.019, -0.01718, 0.1258), (0.019, -0.01718, 0.1258), 0.009, STEEL, collides=False),
    )
    return _gripper(
        "rg2",
        flange,
        linkage,
        hand=LinkSpec("rg2_hand", 0.60, (0.0, 0.0, 0.06), _box_inertia(0.60, (0.04, 0.064, 0.12)), hand),
        crank=_Part(0.040, width_m=0.022, thickness_m=0.013, colour=PALE),
        fingertip=_Part(0.050, width_m=0.020, thickness_m=0.012, colour=DARK),
        motion=_Motion(speed_mps=0.110, speed_range_mps=(0.038, 0.127), force_n=40.0, force_range_n=(3.0, 40.0)),
    )


def robotiq_2f85(flange: str) -> LinkageGripper:
    """Robotiq 2F-85: opens 85 mm, 20-235 N, 20-150 mm/s, 0.9 kg, 163 mm long when closed (datasheet)."""
    linkage = Linkage(
        pivot=(0.0306, 0.0549), crank_m=hypot(0.0376, 0.0430), open_rad=atan2(0.0376, 0.0430), pad=(-0.0257, 0.0324),
        tip_m=0.0512,
    )  # fmt: skip
    hand = (
        rod((0, 0, 0), (0, 0, 0.020), 0.0375, DARK),
        rod((0, 0, 0.020), (0, 0, 0.040), 0.0375, BLACK),
        block((0.040, 0.075, 0.042), (0, 0, 0.045), BLACK),
        block((0.027, 0.060, 0.022), (0, 0, 0.068), BLACK, collides=False),
        rod((-0.0205, 0, 0.052), (0.0205, 0, 0.052), 0.013, STEEL, collides=False),
        rod((-0.015, 0.0306, 0.0549), (0.015, 0.0306, 0.0549), 0.009, STEEL, collides=False),
        rod((-0.015, -0.0306, 0.0549), (0.015, -0.0306, 0.0549), 0.009, STEEL, collides=False),
    )
    return _gripper(
        "robotiq",
        flange,
        linkage,
        hand=LinkSpec("robotiq_hand", 0.70, (0.0, 0.0, 0.04), _box_inertia(0.70, (0.05, 0.075, 0.08)), hand),
        crank=_Part(0.050, width_m=0.027, thickness_m=0.012, colour=STEEL),
        fingertip=_Part(0.050, width_m=0.022, thickness_m=0.008, colour=BLACK),
        motion=_Motion(speed_mps=0.150, speed_range_mps=(0.020, 0.150), force_n=60.0, force_range_n=(20.0, 235.0)),
    )


@dataclass(frozen=True)
class _Part:
    mass_kg: float
    width_m: float
    thickness_m: float
    colour: Vector


@dataclass(frozen=True)
class _Motion:
    speed_mps: float
    speed_range_mps: tuple[float, float]
    force_n: float
    force_range_n: tuple[float, float]


def _gripper(
    name: str, flange: str, linkage: Linkage, hand: LinkSpec, crank: _Part, fingertip: _Part, motion: _Motion
) -> LinkageGripper:
    travel = linkage.open_rad - linkage.closed_rad
    speed = motion.speed_range_mps[1] / linkage.crank_m  # of the crank where it moves the pads the least
    fingers, links = [], [hand]
    for side, sign in (("left", 1.0), ("right", -1.0)):
        names = [f"{name}_{side}_crank", f"{name}_{side}_fingertip"]
        end = (0.0, sign * linkage.crank_m * sin(linkage.open_rad), linkage.crank_m * cos(linkage.open_rad))
        joints = tuple(
            JointSpec(
                f"{link}_joint", parent, link, "revolute", origin, axis=axis, upper=travel, velocity=speed,
                acceleration=100.0, jerk=1e4, effort=20.0,
            )
            for link, parent, origin, axis in (
                (names[0], hand.name, (0.0, sign * linkage.pivot[0], linkage.pivot[1]), (sign, 0.0, 0.0)),
                (names[1], names[0], end, (-sign, 0.0, 0.0)),
            )
        )  # fmt: skip
        links += [_crank(names[0], end, crank), _fingertip(names[1], linkage, sign, fingertip)]
        pad = (0.0, sign * linkage.pad[0], linkage.pad[1])
        fingers.append(
            FingerSpec(
                joints,
                closed=(travel, travel),
                open=(0.0, 0.0),
                links=(names[1],),
                pad_link=names[1],
                pad_point_m=pad,
                tip_point_m=(0.0, pad[1], linkage.tip_m),
            )
        )
    tcp_m = linkage.tip_height_m(linkage.closed_rad) - TIP_BEYOND_TCP_M
    angles = np.linspace(linkage.closed_rad, linkage.open_rad, SAMPLES)
    spec = GripperSpec(
        tuple(fingers),
        openings_m=tuple(linkage.opening_m(angle) for angle in angles),
        tips_m=tuple(linkage.tip_height_m(angle) - tcp_m for angle in angles),
        speed_mps=motion.speed_mps,
        speed_range_mps=motion.speed_range_mps,
        force_n=motion.force_n,
        force_range_n=motion.force_range_n,
        stiffness=30.0,
    )
    fixed = (
        JointSpec(f"{name}_mount_joint", flange, hand.name, "fixed"),
        JointSpec("tcp_joint", hand.name, "tcp", "fixed", (0.0, 0.0, tcp_m)),
    )
    return LinkageGripper(spec, (*links, LinkSpec("tcp")), fixed)


def _crank(name: str, end: Vector, part: _Part) -> LinkSpec:
    """A plate from the pivot to the fingertip's joint, with a pin at either end."""
    _, y, z = end
    length, tilt, half = hypot(y, z), atan2(-y, z), part.width_m / 2
    middle = (0.0, y / 2, z / 2)
    shapes = (
        block((part.width_m, part.thickness_m, length), middle, part.colour, (tilt, 0.0, 0.0)),
        rod((-half, 0.0, 0.0), (half, 0.0, 0.0), part.thickness_m / 2, part.colour, collides=False),
        rod((-half - 0.001, y, z), (half + 0.001, y, z), 0.6 * part.thickness_m, STEEL, collides=False),
    )
    return LinkSpec(name, part.mass_kg, middle, rod_inertia(part.mass_kg, part.thickness_m / 2, length), shapes)


def _fingertip(name: str, linkage: Linkage, sign: float, part: _Part) -> LinkSpec:
    """An arm from its joint inwards, and the pad: a rubber face on a bar."""
    face, (pad_y, pad_z) = 0.003, linkage.pad
    height = 2 * (linkage.tip_m - pad_z)
    bar_y = sign * (pad_y + face + part.thickness_m / 2)
    inwards, top = atan2(-bar_y, pad_z - height / 4), (bar_y / 2, (pad_z - height / 4) / 2)
    shapes = (
        block((part.width_m, face, height), (0.0, sign * (pad_y + face / 2), pad_z), RUBBER),
        block((0.9 * part.width_m, part.thickness_m, height), (0.0, bar_y, pad_z), part.colour),
        block(
            (0.9 * part.width_m, part.thickness_m, hypot(bar_y, pad_z - height / 4) + part.thickness_m / 2),
            (0.0, *top),
            part.colour,
            (inwards, 0.0, 0.0),
        ),
    )
    return LinkSpec(
        name, part.mass_kg, (0.0, bar_y / 2, pad_z / 2), _box_inertia(part.mass_kg, (0.02, 0.02, 0.05)), shapes
    )


def _box_inertia(mass_kg: float, size_m: Vector) -> Inertia:
    x, y, z = size_m
    k = mass_kg / 12
    return k * (y * y + z * z), k * (x * x + z * z), k * (x * x + y * y), 0.0, 0.0, 0.0
