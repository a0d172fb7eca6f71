"""Building settings from plain data: what is accepted, and what the refusals say."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import pytest

from tr_grasp.configs import TrainCfg
from tr_grasp.configs.build import build, leaf_types, nearest_path, plain
from tr_grasp.errors import ConfigError


@dataclass(frozen=True)
class InnerCfg:
    width_m: float = 1.0
    kind: Literal["soft", "hard"] = "soft"

    def __post_init__(self) -> None:
        if self.width_m <= 0:
            raise ConfigError(f"inner.width_m must be positive, got {self.width_m}")


@dataclass(frozen=True)
class OuterCfg:
    count: int = 1
    enabled: bool = True
    name: str = "a"
    folder: Path = Path("runs")
    level: Literal[0, 1] = 0
    limit: float | None = None
    pair: tuple[float, float] = (0.0, 1.0)
    widths: tuple[int, ...] = (1, 2)
    inner: InnerCfg = field(default_factory=InnerCfg)


def test_named_fields_change_and_the_others_stay() -> None:
    base = OuterCfg(name="kept")
    changed = build(base, {"count": 3, "inner": {"kind": "hard"}})
    assert changed == OuterCfg(count=3, name="kept", inner=InnerCfg(kind="hard"))
    assert base == OuterCfg(name="kept")


@pytest.mark.parametrize(
    ("delta", "expected"),
    [
        ({"inner": {"width_m": 2}}, OuterCfg(inner=InnerCfg(width_m=2.0))),
        ({"pair": [1, 2]}, OuterCfg(pair=(1.0, 2.0))),
        ({"widths": []}, OuterCfg(widths=())),
        ({"folder": "elsewhere"}, OuterCfg(folder=Path("elsewhere"))),
        ({"limit": 2}, OuterCfg(limit=2.0)),
        ({"limit": None}, OuterCfg()),
        ({"inner": None}, OuterCfg()),
    ],
)
def test_plain_values_take_the_type_of_their_field(delta: dict, expected: OuterCfg) -> None:
    built = build(OuterCfg(), delta)
    assert built == expected
    assert [type(x) for x in built.pair] == [float, float]
    assert type(built.inner.width_m) is float


@pytest.mark.parametrize(
    ("delta", "message"),
    [
        ({"cuont": 1}, "x.yaml: cuont: unknown; did you mean count?"),
        ({"inner": {"knid": "soft"}}, "x.yaml: inner.knid: unknown; did you mean kind?"),
        ({"kind": "soft"}, "x.yaml: kind: unknown; did you mean inner.kind?"),
        ({"inner": {"count": 2}}, "x.yaml: inner.count: unknown; did you mean count?"),
        ({"inner": {"zzz": 2}}, "x.yaml: inner.zzz: unknown; valid names here: width_m, kind"),
        ({"count": "3"}, "x.yaml: count: must be a whole number, got '3'"),
        ({"count": 3.0}, "x.yaml: count: must be a whole number, got 3.0"),
        ({"count": True}, "x.yaml: count: must be a whole number, got True"),
        ({"enabled": 1}, "x.yaml: enabled: must be true or false, got 1"),
        ({"level": True}, "x.yaml: level: must be one of 0, 1, got True"),
        ({"name": 1}, "x.yaml: name: must be text, got 1"),
        ({"limit": "high"}, "x.yaml: limit: must be a finite number or nothing, got 'high'"),
        ({"limit": float("nan")}, "x.yaml: limit: must be a finite number or nothing, got nan"),
        ({"pair": [1.0]}, "x.yaml: pair: must be a list of 2 values, got 1: [1.0]"),
        ({"pair": 1.0}, "x.yaml: pair: must be a list of 2 values, got 1.0"),
        ({"pair": [1.0, "a"]}, "x.yaml: pair[1]: must be a finite number, got 'a'"),
        ({"widths": [1, 2.5]}, "x.yaml: widths[1]: must be a whole number, got 2.5"),
        ({"widths": "12"}, "x.yaml: widths: must be a list, each a whole number, got '12'"),
        ({"inner": 3}, "x.yaml: inner: expected settings as 'name: value' lines, got 3"),
        (
            {"inner": {"kind": "hrad"}},
            "x.yaml: inner.kind: must be one of 'soft', 'hard', got 'hrad'; did you mean hard?",
        ),
        ({"inner": {"width_m": 0}}, "x.yaml: inner.width_m must be positive, got 0.0"),
    ],
)
def test_a_refusal_names_the_source_the_path_and_the_cure(delta: dict, message: str) -> None:
    with pytest.raises(ConfigError) as refused:
        build(OuterCfg(), delta, source="x.yaml")
    assert str(refused.value) == message


def test_plain_is_undone_by_build() -> None:
    cfg = OuterCfg(count=7, folder=Path("b"), limit=0.5, pair=(1.0, 2.0), widths=(3,), inner=InnerCfg(2.0, "hard"))
    assert build(OuterCfg(), plain(cfg)) == cfg


def test_every_path_of_a_training_run_is_its_own_nearest() -> None:
    for path, _ in leaf_types(TrainCfg):
        assert nearest_path(TrainCfg, path) == path


@pytest.mark.parametrize(
    ("written", "meant"),
    [
        ("env.observation.dpeth", "env.observation.depth"),
        ("objects.split", "env.objects.split"),
        ("algorithm.learning_rate", "optimiser.learning_rate"),
        ("algoritm.gamma", "algorithm.gamma"),
        ("qqqq", None),
    ],
)
def test_the_nearest_path_is_the_one_that_was_meant(written: str, meant: str | None) -> None:
    assert nearest_path(TrainCfg, written) == meant
