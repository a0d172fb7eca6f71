"""Matrix products of float32 on a CPU by oneDNN, where torch would take MKL.

MKL keeps to AVX2 on AMD processors, which is half of what those with AVX-512 can do; oneDNN asks the processor.
"""

from __future__ import annotations

from functools import cache

import torch
from torch import Tensor


def product(a: Tensor, b: Tensor, out: Tensor) -> None:
    """``out = a @ b``."""
    if _has_onednn(a):
        out.copy_(_onednn(a, b))
    else:
        torch.mm(a, b, out=out)


def add_product(total: Tensor, a: Tensor, b: Tensor) -> None:
    """``total += a @ b``, whatever float type the total has."""
    if _has_onednn(a):
        total.add_(_onednn(a, b) if len(a) < b.shape[1] else _onednn(b.t(), a.t()).t())
    elif total.dtype == a.dtype:
        total.addmm_(a, b)
    else:
        total.add_(a @ b)


def _onednn(a: Tensor, b: Tensor) -> Tensor:
    # What torch.compile makes of a linear layer; it takes transposed views as they are.
    return torch.ops.mkldnn._linear_pointwise(a, b.t(), None, "none", [], "")


def _has_onednn(a: Tensor) -> bool:
    return a.dtype == torch.float32 and a.device.type == "cpu" and _is_there()


@cache
def _is_there() -> bool:
    return torch.backends.mkldnn.is_available() and hasattr(torch.ops.mkldnn, "_linear_pointwise")
