"""Colours as people and pictures have them (sRGB), and as light adds up (linear)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def from_linear(linear: ArrayLike) -> NDArray[np.float32]:
    """(*batch, 3) sRGB of linear colours, both in [0, 1].

    Source: IEC 61966-2-1.
    """
    value = np.clip(np.asarray(linear, np.float32), 0, 1)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** np.float32(1 / 2.4) - 0.055).astype(np.float32)


def to_linear(srgb: ArrayLike) -> NDArray[np.float32]:
    """(*batch, 3) linear colours of sRGB, both in [0, 1]; undoes :func:`from_linear`."""
    value = np.clip(np.asarray(srgb, np.float32), 0, 1)
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** np.float32(2.4)).astype(np.float32)
