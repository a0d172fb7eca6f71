"""What a URDF can say that no robot can be: refused here, before a simulator makes something else of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.robots.parts import JointSpec, LinkSpec


def check_tree(links: Sequence[str], joints: Sequence[JointSpec], path: Path) -> None:
    """Refuse links and joints that make no tree.

    Raises:
        ConfigError: Two of one name, a joint of an unknown link, a link that two joints move, or joints in a circle.
    """
    for kind, names in (("link", links), ("joint", [joint.name for joint in joints])):
        for name, count in Counter(names).items():
            if count > 1:
                raise ConfigError(f"'{path}' has {count} {kind}s of the name '{name}'; rename all but one.")
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ConfigError(f"joint '{joint.name}' of '{path}': {unknown_name('link', link, links)}")
    above: dict[str, JointSpec] = {}
    for joint in joints:
        other = above.setdefault(joint.child, joint)
        if other is not joint:
            raise ConfigError(
                f"joints '{other.name}' and '{joint.name}' of '{path}' both move link '{joint.child}'; remove one."
            )
    for joint in joints:
        link, seen = joint.parent, {joint.child}
        while link in above and link not in seen:
            seen.add(link)
            link = above[link].parent
        if link in seen:
            raise ConfigError(f"joint '{joint.name}' of '{path}' is part of a circle of joints; remove one of them.")


def check_masses(links: Iterable[LinkSpec], moving: Iterable[JointSpec], path: Path) -> None:
    """Refuse a link that a joint moves and no body can be: a simulator would give it a mass or inertia of its own.

    Raises:
        ConfigError: Such a link.
    """
    by_name = {link.name: link for link in links}
    for joint in moving:
        link = by_name[joint.child]
        if link.mass_kg <= 0:
            raise ConfigError(
                f"link '{link.name}' of '{path}' has no mass, but joint '{joint.name}' moves it; give it an "
                "<inertial> with a positive mass."
            )
        if not _can_exist(link):
            raise ConfigError(
                f"link '{link.name}' of '{path}' has an inertia that no body has, but joint '{joint.name}' moves it; "
                "give it an <inertia> whose principal moments are positive."
            )


def _can_exist(link: LinkSpec) -> bool:
    xx, yy, zz, xy, xz, yz = link.inertia_kgm2
    return bool((np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) > 0).all())
