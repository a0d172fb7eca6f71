"""What the thesis reports: tables 5.8 to 5.11, 100 trials for each object and motion."""

from __future__ import annotations

from typing import NamedTuple

from tr_grasp.configs.dynamic import DYNAMIC_OBJECTS, THESIS_MOTIONS

ALL = "all"
PREDICTORS = ("Kalman filter", "MLP", "LSTM")
TRIALS_N = 100


class Cell(NamedTuple):
    """Success [%] and mean time [s]."""

    success: float
    time_s: float


_SHORT = dict(zip(("bleach", "meat", "drill", "mustard", "sugar"), DYNAMIC_OBJECTS, strict=True))
_KALMAN = """
bleach  82 17.1268  82 18.0885  53 25.4492  74 16.2566  15 26.8206
meat    86 12.6949  82 13.5474  55 25.6200  85 13.2181   8 25.0831
drill   88  9.8143  84  9.1870  31 22.1733  81  9.7166  16 17.9101
mustard 87 15.5122  82 18.6734  47 26.3625  78 15.1800  10 27.2544
sugar   86 13.3597  84 13.8027  47 25.4042  88 12.4203   5 22.9465
all   85.8 13.7016 82.8 14.6598 46.6 25.0018 81.2 13.3583 10.8 24.0029
"""
_MLP = """
bleach  88 17.3113  78 18.3565  51 24.9106  - -  66 22.5683
meat    84 14.3890  80 13.5307  55 25.8155  - -  79 15.7835
drill   91 10.2867  91  8.7359  30 21.9116  - -  88 11.6545
mustard 88 16.4776  78 19.2276  49 26.4544  - -  63 22.8853
sugar   74 15.1663  79 15.5597  46 25.9263  - -  78 17.1639
all     85 14.7262 81.2 15.0821 46.2 25.0037 - - 74.8 18.0111
"""
_LSTM = """
bleach  82 16.5867  82 18.6834  49 25.2586  - -  75 21.0621
meat    90 12.2976  86 13.0665  54 25.0033  - -  85 15.6227
drill   85  9.3358  89  8.7544  30 21.6791  - -  82 11.6880
mustard 87 17.2409  77 18.9082  49 25.7427  - -  63 23.4247
sugar   83 14.0838  88 14.5649  49 25.2388  - -  74 17.6545
all   85.4 13.9090 84.4 14.7954 46.2 24.5845 - - 75.8 17.8904
"""


def _table(text: str) -> dict[tuple[str, str], Cell]:
    cells = {}
    for line in text.strip().splitlines():
        name, *numbers = line.split()
        for k, motion in enumerate(THESIS_MOTIONS):
            success, time_s = numbers[2 * k : 2 * k + 2]
            if success != "-":
                cells[_SHORT.get(name, ALL), motion] = Cell(float(success), float(time_s))
    return cells


THESIS: dict[str, dict[tuple[str, str], Cell]] = dict(zip(PREDICTORS, map(_table, (_KALMAN, _MLP, _LSTM)), strict=True))
"""By predictor, then (object or ``all``, motion). The networks have no circles: they would need their own training."""


def best(object_name: str, motion: str) -> Cell | None:
    """The highest success of the three predictors, with its time; nothing for motions that the thesis lacks."""
    cells = [table[object_name, motion] for table in THESIS.values() if (object_name, motion) in table]
    return max(cells, key=lambda cell: (cell.success, -cell.time_s)) if cells else None
