"""A method beside what it becomes when one thing is different: a part of it, or how well the target is tracked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, get_args

from tr_grasp.dynamic.settings import PredictorName
from tr_grasp.grasps.ranking import RankingName

if TYPE_CHECKING:
    from tr_grasp.evaluation.dynamic.run import Contender  # loads a simulator

StudyName = Literal["none", "ablations", "noise", "latency"]
SWITCHES = ("seeding", "switching", "retry", "look_ahead")
NOISES_MM = (0, 1, 2, 5)
LATENCIES_MS = (0, 50, 100, 200)


def variations(base: Contender, study: StudyName) -> tuple[Contender, ...]:
    """The method itself, then its variations, each with one setting changed and named for it.

    Args:
        base: The method, and its world.
        study: ``ablations``: every other predictor and ranking, and each switch turned over. ``noise`` and ``latency``:
            worse tracking.
    """
    others = {"none": _nothing, "ablations": _ablations, "noise": _noises, "latency": _latencies}[study](base)
    return (base, *others)


def _nothing(base: Contender) -> Iterator[Contender]:
    yield from ()


def _ablations(base: Contender) -> Iterator[Contender]:
    cfg = base.cfg
    for predictor in get_args(PredictorName):
        if predictor != cfg.predictor:
            yield _changed(base, f"predictor-{predictor}", predictor=predictor)
    for ranking in get_args(RankingName):
        if ranking != cfg.ranking:
            yield _changed(base, f"ranking-{ranking}", ranking=ranking)
    for switch in SWITCHES:
        is_on = getattr(cfg, switch)
        yield _changed(base, f"{'without' if is_on else 'with'}-{switch}", **{switch: not is_on})


def _noises(base: Contender) -> Iterator[Contender]:
    for noise_mm in NOISES_MM:
        if noise_mm * 1e-3 != base.world.tracking.noise_m:
            yield _tracked(base, f"noise-{noise_mm}mm", noise_m=noise_mm * 1e-3)


def _latencies(base: Contender) -> Iterator[Contender]:
    for latency_ms in LATENCIES_MS:
        if latency_ms * 1e-3 != base.world.tracking.latency_s:
            yield _tracked(base, f"latency-{latency_ms}ms", latency_s=latency_ms * 1e-3)


def _changed(base: Contender, what: str, **changes: object) -> Contender:
    return replace(base, name=_name(base, what), cfg=replace(base.cfg, **changes))


def _tracked(base: Contender, what: str, **changes: float) -> Contender:
    tracking = replace(base.world.tracking, **changes)
    return replace(base, name=_name(base, what), world=replace(base.world, tracking=tracking))


def _name(base: Contender, what: str) -> str:
    return f"{base.name}-{what.replace('_', '-')}"
