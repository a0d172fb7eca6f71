"""``tr-grasp pick-place --trials N``: how often it succeeds with the object shifted and turned."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tr_grasp.errors import ConfigError
from tr_grasp.files import make_folder, write_atomically

if TYPE_CHECKING:
    from tr_grasp.cli.pick_place import PickPlaceCfg
    from tr_grasp.pick_place import StationCfg

FAILED = 1


def many(cfg: PickPlaceCfg, station: StationCfg) -> int:
    """Trials with the object shifted, and what became of them."""
    from tr_grasp.evaluation.pick_place import PickPlaceTrial, pick_place_trials
    from tr_grasp.evaluation.statistics import Counts, wilson_interval

    grasp = cfg.grasp if cfg.find == "camera" else None
    what = {"station": cfg.station, "grasp": grasp or "blind", "largest_shift_m": cfg.shift_m, "retries": cfg.retries}
    seeds = range(cfg.seed, cfg.seed + cfg.trials)
    rows = {seed: row for seed, row in known(cfg.out, what).items() if seed in seeds}
    missing = [seed for seed in seeds if seed not in rows]
    for trial in pick_place_trials(station, missing, shift_m=cfg.shift_m, retries_n=cfg.retries, grasp=grasp):
        rows[trial.seed] = what | dataclasses.asdict(trial)
        print(
            f"seed {trial.seed}  {'placed' if trial.placed else 'not placed'}  {trial.touches_n} touches  "
            f"{trial.cycle_s:.1f} s  {trial.reason}",
            flush=True,
        )
        if cfg.out is not None:
            make_folder(cfg.out.parent)
            write_atomically(cfg.out, "".join(json.dumps(rows[seed]) + "\n" for seed in sorted(rows)))
    names = {field.name for field in dataclasses.fields(PickPlaceTrial)}
    trials = [PickPlaceTrial(**{name: row[name] for name in names}) for row in rows.values()]
    good = [trial for trial in trials if trial.succeeded]
    low, high = wilson_interval(Counts(len(good), len(trials)))
    times = [trial.cycle_s for trial in good]
    print(
        f"{len(good)} of {len(trials)} placed without touching a wall [{100 * low:.0f}, {100 * high:.0f}] %, "
        f"{sum(trial.upright for trial in good)} of them upright, {sum(trial.touches_n for trial in trials)} touches, "
        f"{sum(trial.retries_n for trial in trials)} retries"
        + (f", cycle {np.mean(times):.1f} s ({min(times):.1f} to {max(times):.1f})" if times else "")
    )
    return 0 if len(good) == len(trials) else FAILED


def known(path: Path | None, what: dict[str, Any]) -> dict[int, dict[str, Any]]:
    """Rows of an earlier run by their seed; none without a file.

    Raises:
        ConfigError: It holds something else.
    """
    if path is None or not path.exists():
        return {}
    try:
        rows = [json.loads(line) for line in path.read_text().splitlines()]
        others = [row for row in rows if {name: row[name] for name in what} != what]
        found = {row["seed"]: row for row in rows}
    except (ValueError, KeyError, TypeError):
        raise ConfigError(f"--out: '{path}' holds no trials of pick and place; name another file.") from None
    if others:
        raise ConfigError(f"--out: '{path}' holds trials with other settings than {what}; name another file.")
    return found
