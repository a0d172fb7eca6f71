"""Named sets of held-out episodes: the same scenes for everybody who is judged."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from tr_grasp.configs import EnvCfg, ObjectsCfg
from tr_grasp.errors import ConfigError, unknown_name
from tr_grasp.objects.sets import PROCEDURAL, PROCEDURAL_WIDE, source_folder


@dataclass(frozen=True)
class Suite:
    """Episodes with consecutive seeds in one kind of world.

    Every episode has its own seed, from which its scene is built afresh: its result depends on nothing that
    happened before it.
    """

    name: str
    """What tables and files call it."""
    env: EnvCfg
    """The world."""
    episodes: int
    """How many."""
    first_seed: int
    """Seed of episode 0; episode ``i`` has ``first_seed + i``."""

    def __post_init__(self) -> None:
        if self.episodes < 1:
            raise ConfigError(f"episodes must be at least 1, got {self.episodes}.")
        if self.first_seed < 0:
            raise ConfigError(f"seed must not be negative, got {self.first_seed}.")

    def seed(self, episode: int) -> int:
        """Seed of an episode."""
        return self.first_seed + episode


@dataclass(frozen=True)
class Arrangement:
    """How many objects lie there, and how."""

    count_range: tuple[int, int]
    arrangement: Literal["scattered", "pile"]
    words: str


ARRANGEMENTS = {
    "single": Arrangement((1, 1), "scattered", "1 object"),
    "scattered": Arrangement((2, 4), "scattered", "2-4 objects, apart"),
    "pile": Arrangement((4, 4), "pile", "4 objects dropped in a pile"),
}
"""Every named suite."""

ALL = "all"
PROCEDURAL_SPLITS: tuple[Literal["train", "test"], ...] = ("test", "train")


def named_suites(which: str, base: EnvCfg, *, objects: str, episodes: int, first_seed: int) -> list[Suite]:
    """Suites by name for one policy's own world.

    Args:
        which: A name in ``ARRANGEMENTS``, or ``all``.
        base: What the policy was trained in: its camera, observation, action and control rate are kept.
        objects: ``test`` or ``train`` for procedural objects; ``procedural_wide`` or a folder of meshes for their test
            split.
        episodes: Episodes of each suite.
        first_seed: Seed of the first episode of each suite.

    Raises:
        ConfigError: If there is no such suite or folder, or no episode.
    """
    if which not in (ALL, *ARRANGEMENTS):
        raise ConfigError(unknown_name("suite", which, [ALL, *ARRANGEMENTS]))
    names = list(ARRANGEMENTS) if which == ALL else [which]
    source = objects_from(objects, base.objects)
    return [
        Suite(name, replace(base, fresh_scene_every_n=1, objects=_arranged(source, name)), episodes, first_seed)
        for name in names
    ]


def objects_from(objects: str, base: ObjectsCfg) -> ObjectsCfg:
    """Procedural objects of a split (``test``, ``train``), wider ones (``procedural_wide``), or meshes from a folder.

    Raises:
        ConfigError: If it is neither a split nor a folder.
    """
    base = replace(base, lone_wide_share=0.0)  # the suite says how many objects there are
    for split in PROCEDURAL_SPLITS:
        if objects == split:
            return replace(base, source=PROCEDURAL, split=split)
    if objects == PROCEDURAL_WIDE:
        return replace(base, source=PROCEDURAL_WIDE, split="test")
    try:
        folder = source_folder(objects)
    except ConfigError as error:
        raise ConfigError(
            f"objects must be test, train, a folder of meshes or the name of one; {objects!r} is none of them: {error}"
        ) from error
    # What is also a training object is not judged.
    return replace(base, source=str(folder.resolve()), split="test", overlap="leave_out")


def _arranged(objects: ObjectsCfg, name: str) -> ObjectsCfg:
    wanted = ARRANGEMENTS[name]
    return replace(objects, count_range=wanted.count_range, arrangement=wanted.arrangement)
