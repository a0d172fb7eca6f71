"""A trained policy as one file that runs without this package."""

from tr_grasp.modules.export.dense_policy import DensePolicy, exportable_encoders
from tr_grasp.modules.export.formats import ExportFormat, Runner, export_onnx, export_torch, open_onnx, open_torch
from tr_grasp.modules.export.parity import (
    TOLERANCE,
    Observations,
    Parity,
    as_runner,
    measure_parity,
    random_observations,
)
from tr_grasp.modules.export.write import Exported, export_policy

__all__ = [
    "TOLERANCE",
    "DensePolicy",
    "ExportFormat",
    "Exported",
    "Observations",
    "Parity",
    "Runner",
    "as_runner",
    "export_onnx",
    "export_policy",
    "export_torch",
    "exportable_encoders",
    "measure_parity",
    "open_onnx",
    "open_torch",
    "random_observations",
]
