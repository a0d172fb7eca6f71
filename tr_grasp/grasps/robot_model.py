"""What a file that was made for one model of a robot remembers of it."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from tr_grasp.robots import RobotSpec
from tr_grasp.robots.urdf import urdf_text

_NUMBER = re.compile(r"-?\d+\.?\d*(?:[eE][-+]?\d+)?")


def model_text(spec: RobotSpec) -> str:
    """A robot's URDF, the same wherever its meshes are installed and in whatever order its numbers were summed."""
    links = tuple(
        replace(
            link,
            shapes=tuple(replace(s, mesh=None if s.mesh is None else Path(s.mesh.name)) for s in link.shapes),
        )
        for link in spec.links
    )
    return _NUMBER.sub(_rounded, urdf_text(replace(spec, links=links)))


def _rounded(number: re.Match[str]) -> str:
    return f"{float(number.group()) + 0.0:.5f}".replace("-0.00000", "0.00000")
