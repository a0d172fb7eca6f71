"""The procedural families: those of ``FAMILIES`` have sizes that a gripper that opens 80 mm can take.

Solids of one object touch and do not overlap, so that its mass and inertia are those of the real solid. A builder
stands the object on any convenient origin; ``ObjectModel.assemble`` moves it to the centre of mass.
"""

from __future__ import annotations

from tr_grasp.objects import solids, tools, vessels, wide
from tr_grasp.objects.family import Family, Split

FAMILIES: dict[str, Family] = {family.name: family for family in (*solids.ALL, *vessels.ALL, *tools.ALL)}
"""Every family of the set ``procedural``, by name."""

WIDE: dict[str, Family] = {family.name: family for family in wide.ALL}
"""Those that the set ``procedural_wide`` has besides."""


def family_names(split: Split) -> list[str]:
    """Families that the split draws from, in a fixed order: held-out ones are in the test split alone."""
    return [name for name, family in FAMILIES.items() if split == "test" or not family.held_out]
