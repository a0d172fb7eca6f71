"""The examples do what they say, and stay short."""

from __future__ import annotations

import runpy
from math import isfinite
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
LINES_N = 60


def example(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))


def test_an_encoder_learns_in_plain_pytorch() -> None:
    before, after = example("encoder_in_plain_pytorch")["main"](updates=20)
    assert after < 0.5 * before


def test_every_head_takes_an_update() -> None:
    losses = example("swap_a_head")["main"]()
    assert list(losses) == ["default", "dueling", "bilinear"]
    assert all(isfinite(value) for named in losses.values() for value in named.values())
    assert len({named["loss_qvalue"] for named in losses.values()}) == 3


def test_tqc_learns_the_toy() -> None:
    rewards = example("tqc_on_a_toy_environment")["main"](rounds=12, updates_n=10)
    assert rewards[-1] > 0.6 * rewards[0]


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_an_example_is_short(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) < LINES_N


def test_every_example_is_run_here() -> None:
    source = Path(__file__).read_text(encoding="utf-8")
    assert [path.stem for path in EXAMPLES.glob("*.py") if f'example("{path.stem}")' not in source] == []
