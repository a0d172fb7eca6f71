"""Arbitrary settings, for the laws of reading and writing."""

from __future__ import annotations

import types
from typing import Any, Literal, get_args, get_origin

from hypothesis import strategies as st

from tr_grasp.configs import TrainCfg
from tr_grasp.configs.build import build, leaf_types
from tr_grasp.errors import ConfigError


def values(hint: Any) -> st.SearchStrategy[Any]:
    """Plain values of a setting's type."""
    if get_origin(hint) is Literal:
        return st.sampled_from(get_args(hint))
    if get_origin(hint) is types.UnionType:
        return st.one_of(*map(values, get_args(hint)))
    if get_origin(hint) is tuple:
        kinds = get_args(hint)
        if Ellipsis in kinds:
            return st.lists(values(kinds[0]), min_size=1, max_size=4)
        return st.tuples(*map(values, kinds)).map(list)
    plain = {
        types.NoneType: st.none(),
        bool: st.booleans(),
        int: st.integers(0, 10**9),
        float: st.floats(allow_nan=False, allow_infinity=False),
        str: st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=12),
    }
    return plain[hint]


def delta_of(path: str, value: Any) -> dict[str, Any]:
    """``{"env": {"objects": {"split": value}}}`` for ``env.objects.split``."""
    for name in reversed(path.split(".")):
        value = {name: value}
    return value


@st.composite
def changes(draw: st.DrawFn, max_n: int = 5) -> list[tuple[str, Any]]:
    """Dotted paths and new values of a training run, each accepted by the settings' own checks."""
    hints = dict(leaf_types(TrainCfg))
    accepted, cfg = [], TrainCfg()
    for path in draw(st.lists(st.sampled_from(sorted(hints)), max_size=max_n, unique=True)):
        value = draw(values(hints[path]))
        try:
            cfg = build(cfg, delta_of(path, value))
        except ConfigError:
            continue
        accepted.append((path, value))
    return accepted


@st.composite
def train_cfgs(draw: st.DrawFn) -> TrainCfg:
    """Training runs that differ from the default in up to twenty settings."""
    cfg = TrainCfg()
    for path, value in draw(changes(max_n=20)):
        cfg = build(cfg, delta_of(path, value))
    return cfg
