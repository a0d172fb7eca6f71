"""A trial again, on film: what happened, and a line that tells it."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from tr_grasp.dynamic.record import TrialRecord
from tr_grasp.envs.dynamic_grasp import run_trial
from tr_grasp.envs.dynamic_grasp.film import Filming, camera_for
from tr_grasp.evaluation.dynamic.run import Job

Picture = NDArray[np.uint8]

SIZE_PX, PERIOD_S = 360, 0.15
FRAME_S = PERIOD_S / 2
"""How long each frame is shown: time runs twice as fast."""
BAND_PX, BAND, TEXT, GOOD, BAD = 26, (24, 30, 42), (226, 232, 240), (52, 168, 104), (240, 122, 110)


def film_trial(job: Job, size_px: int = SIZE_PX) -> tuple[TrialRecord, list[Picture]]:
    """Run a trial and film it: the row that it gives, and its frames, ``FRAME_S`` each.

    A method that is charged the time it took may do something else the second time.
    """
    camera = camera_for(*_seen_from(job), size_px)
    filming = Filming(camera, PERIOD_S)
    record = run_trial(job.world, job.trial, job.method, camera=camera, on_scene=filming)
    record = replace(record, method=job.contender.name)
    shown = zip(filming.film.pictures, filming.film.times_s, strict=True)
    frames = [_captioned(picture, caption(record, time_s), None) for picture, time_s in shown]
    frames[-1] = _captioned(filming.film.pictures[-1], f"{record.end_s:5.1f} s   {record.outcome}", record.success)
    return record, frames


def caption(record: TrialRecord, time_s: float) -> str:
    """What a trial that ended like this was at, at a time."""
    marks = [(0.0, "reaching")]
    if record.committed:
        marks.append((record.time_s, "grasping"))
    if record.lifted_s is not None:
        marks.append((record.lifted_s, "lifted"))
    word = [word for begun_s, word in marks if time_s >= begun_s][-1]
    return f"{time_s:5.1f} s   {word}"


def choose(records: Sequence[TrialRecord], count: int) -> list[TrialRecord]:
    """A few telling trials: failures of different reasons first, in turn with successes of different motions."""
    failures = _spread([r for r in records if not r.success], lambda r: (r.outcome, r.motion))
    successes = _spread([r for r in records if r.success], lambda r: (r.motion, r.object_name))
    mixed = [r for pair in zip_longest(failures, successes) for r in pair if r is not None]
    return mixed[:count]


def _spread(records: Sequence[TrialRecord], kind: Callable[[TrialRecord], Hashable]) -> Iterator[TrialRecord]:
    """Those of different kinds first."""
    seen: set[Hashable] = set()
    rest = []
    for record in records:
        if kind(record) in seen:
            rest.append(record)
        else:
            seen.add(kind(record))
            yield record
    yield from rest


def _seen_from(job: Job) -> tuple[float, float]:
    """Distance and direction of the path's middle, wherever its kind has them."""
    path = job.trial.path(job.world.speed_m_s)
    x, y, _ = path.at(float(path.duration_s[0]) / 2).position[0].tolist()
    return float(np.hypot(x, y)), float(np.arctan2(y, x))


def _captioned(picture: Picture, text: str, success: bool | None) -> Picture:
    size = len(picture)
    canvas = Image.new("RGB", (size, size + BAND_PX), BAND)
    canvas.paste(Image.fromarray(picture), (0, 0))
    colour = TEXT if success is None else GOOD if success else BAD
    ImageDraw.Draw(canvas).text((8, size + 5), text, fill=colour, font=_font())
    return np.asarray(canvas)


@lru_cache
def _font() -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(14)
