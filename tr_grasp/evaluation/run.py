"""A whole evaluation: play, keep every episode, film a few, report."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from tr_grasp.envs import make_env as make_simulation
from tr_grasp.errors import StorageError
from tr_grasp.evaluation.film import encode_gif
from tr_grasp.evaluation.players import Player, load_player
from tr_grasp.evaluation.records import EPISODES_FILE, EpisodeLog, EpisodeRecord, by_suite, write_episodes
from tr_grasp.evaluation.replay import choose_episodes, record_episode
from tr_grasp.evaluation.replay_view import ReplayView
from tr_grasp.evaluation.report import Evaluation, Shown, report_html
from tr_grasp.evaluation.rollouts import EnvMaker, PlayerLoader, one_thread, run_suites
from tr_grasp.evaluation.suites import Suite
from tr_grasp.files import write_atomically
from tr_grasp.provenance import Provenance

SUMMARY_FILE = "summary.json"
REPORT_FILE = "report.html"
REPLAYS_FOLDER = "replays"
REPLAY_SPEED = 2.0


@dataclass(frozen=True, eq=False)
class Finished:
    """What an evaluation left behind."""

    evaluation: Evaluation
    """Its episodes and where they come from."""
    report: Path
    """The HTML page."""
    replays: tuple[Path, ...]
    """The films, as GIF."""
    was_interrupted: bool
    """Ctrl-C ended it early; what was finished until then is all there."""


def evaluate(
    player: Player,
    suites: Sequence[Suite],
    out: Path,
    provenance: Provenance,
    *,
    workers: int = 1,
    replays_per_suite: int = 4,
    on_episode: Callable[[EpisodeRecord], None] = lambda record: None,
    make_env: EnvMaker = make_simulation,
    load: PlayerLoader = load_player,
) -> Finished | None:
    """Judge a player and write ``episodes.csv``, ``summary.json``, ``report.html`` and ``replays/*.gif``.

    Every episode is in ``episodes.csv`` as soon as it is over. Ctrl-C ends the playing, not the report.

    Args:
        player: Who plays.
        suites: What to play.
        out: Folder of the results; made if needed, files of an earlier evaluation in it are replaced.
        provenance: Where the results come from.
        workers: Processes; the results do not depend on them.
        replays_per_suite: Films of each suite.
        on_episode: Called after each episode.
        make_env: Builds a world.
        load: Loads the player in a worker.

    Returns:
        None if Ctrl-C came before the first episode was over.

    Raises:
        StorageError: If a file cannot be written.
    """
    records: list[EpisodeRecord] = []
    was_interrupted = False
    with EpisodeLog(out / EPISODES_FILE) as log:
        try:
            with closing(run_suites(suites, player.name, workers=workers, make_env=make_env, load=load)) as played:
                for record in played:
                    records.append(record)
                    log.append(record)
                    on_episode(record)
        except KeyboardInterrupt:
            was_interrupted = True
    if not records:
        return None
    write_episodes(out / EPISODES_FILE, records)
    evaluation = Evaluation(player.name, suites, records, provenance, player.training)
    write_atomically(out / SUMMARY_FILE, json.dumps(evaluation.as_json(), indent=2) + "\n")
    shown: list[Shown] = []
    if not was_interrupted:
        try:
            shown.extend(film_episodes(player, suites, records, replays_per_suite, make_env))
        except KeyboardInterrupt:
            was_interrupted = True
    write_atomically(out / REPORT_FILE, report_html(evaluation, shown))
    return Finished(evaluation, out / REPORT_FILE, _save_films(out / REPLAYS_FOLDER, shown), was_interrupted)


def film_episodes(
    player: Player,
    suites: Sequence[Suite],
    records: Sequence[EpisodeRecord],
    per_suite: int,
    make_env: EnvMaker = make_simulation,
) -> Iterator[Shown]:
    """Play a few telling episodes of each suite again and film them."""
    groups = by_suite(records)
    for suite in suites:
        chosen = choose_episodes(groups.get(suite.name, ()), per_suite)
        if not chosen:
            continue
        view = ReplayView(suite.env)
        with one_thread(), closing(make_env(suite.env)) as env:
            for record in chosen:
                replayed, steps = record_episode(env, player.policy, suite, record.episode)
                yield Shown(record, replayed, encode_gif(list(view.frames(steps)), frame_s(suite)))


def frame_s(suite: Suite) -> float:
    """How long a film shows one policy step: time runs twice as fast."""
    return 1 / suite.env.control_hz / REPLAY_SPEED


def _save_films(folder: Path, shown: Sequence[Shown]) -> tuple[Path, ...]:
    if not shown:
        return ()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.glob("*.gif"):
            old.unlink()
    except OSError as error:
        raise StorageError(f"could not write the folder '{folder}': {error.strerror}.") from error
    paths = []
    for film in shown:
        end = "success" if film.replayed.success else "failure"
        paths.append(folder / f"{film.evaluated.suite}_seed{film.evaluated.seed}_{end}.gif")
        write_atomically(paths[-1], film.gif)
    return tuple(paths)
