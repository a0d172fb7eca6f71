"""``tr-grasp play``: watch somebody grasp."""

from __future__ import annotations

import time
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from tr_grasp.cli.vulkan import require_vulkan
from tr_grasp.configs import RandomisationCfg
from tr_grasp.configs.io import parse
from tr_grasp.errors import ConfigError
from tr_grasp.files import make_folder

if TYPE_CHECKING:
    from tr_grasp.evaluation.players import Player
    from tr_grasp.evaluation.records import EpisodeRecord
    from tr_grasp.evaluation.replay import ReplayStep
    from tr_grasp.evaluation.suites import Suite

MOST_FILMED = 10
PAUSE_FRAMES = 6
"""How often the last frame of an episode is repeated before the next one starts."""
GIF_BYTES_PER_EPISODE = 1_500_000


@dataclass(frozen=True)
class PlayCfg:
    """Let somebody play some episodes, print what happens and, if wanted, film it."""

    agent: str = "scripted"
    """zero, random, scripted, a shipped policy (panda), or the folder of a saved one."""

    episodes: int = 3
    """How many."""

    robot: str | None = None
    """The arm of scripted, random or zero: panda, ur5_rg2, ur5_robotiq_2f85, j2s7s300 or your own YAML file."""

    objects: str = "test"
    """test or train for procedural objects, procedural_wide, or a folder with one sub-folder per object."""

    suite: Literal["single", "scattered", "pile"] = "scattered"
    """One object, 2-4 objects apart, or 4 in a dropped pile."""

    random_looks: bool = False
    """Another ground texture, other colours and another light in every episode."""

    seed: int = 30_000
    """Seed of the first episode; the next ones have the next seeds."""

    each_step: bool = False
    """Print a line for every step, not only for every episode."""

    view: Path | None = None
    """Film the episodes into this GIF or MP4; a PNG gets six pictures of them."""

    view_camera: Literal["raycast", "sapien"] = "raycast"
    """Who draws the film: the ray caster, or SAPIEN's renderer where there is a Vulkan device."""

    browser: bool = False
    """Show the scene in the browser while it is played, with a slider to go back (pip install 'tr-grasp[viewer]')."""

    port: int = 8080
    """Where the browser finds it; the next free one if it is taken."""

    def __post_init__(self) -> None:
        if self.browser and (self.view is not None or self.each_step):
            raise ConfigError("--browser shows every step by itself; leave out --view and --each-step.")
        if self.view is not None and self.episodes > MOST_FILMED:
            raise ConfigError(f"--view films at most {MOST_FILMED} episodes, got --episodes {self.episodes}.")


def main(args: list[str]) -> int:
    """Run the verb."""
    cfg = parse(PlayCfg, args, prog="tr-grasp play")
    # --help must not wait for a simulator.
    from tr_grasp.envs import make_env
    from tr_grasp.evaluation.film import check_format, save_film
    from tr_grasp.evaluation.players import load_player, with_robot
    from tr_grasp.evaluation.replay import record_episode
    from tr_grasp.evaluation.replay_view import ReplayView
    from tr_grasp.evaluation.rollouts import one_thread, run_episode
    from tr_grasp.evaluation.run import frame_s
    from tr_grasp.evaluation.suites import named_suites

    if cfg.view is not None:
        check_format(cfg.view)
        make_folder(cfg.view.parent)
    photographs = cfg.view is not None and cfg.view_camera == "sapien"
    if photographs:
        require_vulkan("--view-camera sapien", "--view-camera raycast")
    player = with_robot(load_player(cfg.agent), cfg.robot)
    if cfg.random_looks:
        player = replace(player, env=replace(player.env, randomise=with_random_looks(player.env.randomise)))
    (suite,) = named_suites(cfg.suite, player.env, objects=cfg.objects, episodes=cfg.episodes, first_seed=cfg.seed)
    if cfg.browser:
        return play_in_browser(cfg, player, suite)
    view = ReplayView(suite.env)
    film: list[NDArray[np.uint8]] = []
    with one_thread(), closing(make_env(suite.env, photographs=photographs)) as env:
        for episode in range(cfg.episodes):
            if cfg.view is None and not cfg.each_step:
                print(episode_line(run_episode(env, player.policy, suite, episode)), flush=True)
                continue
            record, steps = record_episode(env, player.policy, suite, episode, cfg.view_camera)
            if cfg.each_step:
                print("\n".join(step_line(step) for step in steps))
            print(episode_line(record), flush=True)
            if cfg.view is not None:
                film += view.frames(steps)
                film += [film[-1]] * PAUSE_FRAMES
    if cfg.view is not None:
        save_film(cfg.view, film[:-PAUSE_FRAMES], frame_s(suite), cfg.episodes * GIF_BYTES_PER_EPISODE)
        print(f"film  {cfg.view}")
    return 0


def with_random_looks(switches: RandomisationCfg) -> RandomisationCfg:
    """All that changes colours switched on."""
    return replace(switches, ground_texture=True, table_colour=True, object_tint=True, light=True)


def play_in_browser(cfg: PlayCfg, player: Player, suite: Suite) -> int:
    """Play the episodes for everybody who has the page open, and leave it there until Ctrl-C."""
    from tr_grasp.envs import make_env
    from tr_grasp.evaluation.browser import BrowserView
    from tr_grasp.evaluation.rollouts import one_thread, run_episode
    from tr_grasp.evaluation.run import frame_s

    with closing(BrowserView(cfg.port, frame_s(suite))) as page, one_thread(), closing(make_env(suite.env)) as env:
        print(f"page  {page.address}", flush=True)
        for episode in range(cfg.episodes):
            print(episode_line(run_episode(env, player.policy, suite, episode, page)), flush=True)
        print("The last episode stays on the page; Ctrl-C ends.", flush=True)
        wait_for_ctrl_c()
    return 0


def wait_for_ctrl_c() -> None:
    """Return when somebody presses it."""
    try:
        while True:
            time.sleep(1.0)
    except KeyboardInterrupt:
        return


def episode_line(record: EpisodeRecord) -> str:
    """One episode in one line."""
    return (
        f"episode {record.episode}  seed {record.seed}  {record.outcome}  steps {record.steps}  "
        f"reward {record.reward:.1f}  objects {', '.join(record.families)}"
    )


def step_line(step: ReplayStep) -> str:
    """One step in one line."""
    from tr_grasp.evaluation.replay_view import STAGES, action_text

    done = [name for name, flag in zip(STAGES, step.stages, strict=True) if flag]
    x, y, z = step.proprio[1:4]
    return f"  {action_text(step)}   tcp ({x:.3f}, {y:.3f}, {z:.3f}) m   {' '.join(done) or '-'}"
