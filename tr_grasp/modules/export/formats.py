"""A dense policy as the bytes of a file, and such bytes as something to call."""

from __future__ import annotations

import importlib
import io
import json
import logging
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.export import ExportedProgram

from tr_grasp.errors import ExportError
from tr_grasp.modules.export.dense_policy import DensePolicy
from tr_grasp.octree import OctreeFrame

ExportFormat = Literal["onnx", "torch"]

INPUTS = ("codes", "features", "proprio")
OUTPUT = "action"

DESCRIPTION_FILE = "description.json"
"""Where a ``torch`` file keeps its description: ``torch.export.load(path, extra_files={DESCRIPTION_FILE: ""})``."""

Runner = Callable[[Tensor, Tensor, Tensor], Tensor]
"""Codes, features and proprioception to the action, as ``DensePolicy``."""

_ONNX_PACKAGES = ("onnx", "onnxscript", "onnxruntime")


def export_torch(policy: DensePolicy, description: Mapping[str, str]) -> bytes:
    """A file for ``torch.export.load``, for any batch size; the description lies in it as ``DESCRIPTION_FILE``."""
    buffer = io.BytesIO()
    torch.export.save(_trace(policy), buffer, extra_files={DESCRIPTION_FILE: json.dumps(dict(description))})
    return buffer.getvalue()


def export_onnx(policy: DensePolicy, description: Mapping[str, str]) -> bytes:
    """An ONNX file, for any batch size; the description are its metadata.

    Raises:
        ExportError: If a package that it takes is not installed.
    """
    check_onnx_packages()
    with _quiet():
        program = torch.onnx.export(
            _trace(policy), input_names=INPUTS, output_names=[OUTPUT], dynamo=True, verbose=False
        )
    if program is None:
        raise ExportError("PyTorch made no ONNX program of the policy.")
    model = program.model_proto
    _name_batch(model)
    importlib.import_module("onnx.helper").set_model_props(model, dict(description))
    return model.SerializeToString()


def open_torch(content: bytes) -> Runner:
    """What :func:`export_torch` made."""
    module = torch.export.load(io.BytesIO(content)).module()
    return lambda *inputs: module(*inputs)


def open_onnx(content: bytes) -> Runner:
    """What :func:`export_onnx` made, in ONNX Runtime on the CPU with as many threads as torch uses.

    Raises:
        ExportError: If a package that it takes is not installed.
    """
    check_onnx_packages()
    runtime = importlib.import_module("onnxruntime")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = torch.get_num_threads()
    session = runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])

    def run(*inputs: Tensor) -> Tensor:
        arrays: dict[str, NDArray[Any]] = {name: np.asarray(x) for name, x in zip(INPUTS, inputs, strict=True)}
        return torch.from_numpy(session.run([OUTPUT], arrays)[0])

    return run


def check_onnx_packages() -> None:
    """Fail before the work and not after it.

    Raises:
        ExportError: If one of the packages is not installed.
    """
    for package in _ONNX_PACKAGES:
        try:
            importlib.import_module(package)
        except ImportError as error:
            raise ExportError(
                f"ONNX files need the package {package}: pip install 'tr-grasp[export]'; --format torch needs no more."
            ) from error


def _trace(policy: DensePolicy) -> ExportedProgram:
    spec = policy.env_spec
    frames = OctreeFrame.unoccupied(spec.octree, (2, spec.stack_n))
    example = (frames.codes, frames.features, torch.zeros(2, spec.stack_n, spec.proprio_n))
    any_batch = {0: torch.export.Dim("batch", min=1)}
    with _quiet():
        return torch.export.export(policy, example, dynamic_shapes=(any_batch,) * len(example))


def _name_batch(model: Any) -> None:
    """Call the open dimension ``batch``, which is what it was called when the graph was traced."""
    graph = model.graph
    made_up = graph.input[0].type.tensor_type.shape.dim[0].dim_param
    for value in (*graph.input, *graph.output, *graph.value_info):
        for dimension in value.type.tensor_type.shape.dim:
            if dimension.dim_param:
                dimension.dim_param = dimension.dim_param.replace(made_up, "batch")


@contextmanager
def _quiet() -> Iterator[None]:
    """PyTorch's exporter speaks of its own deprecations, and of torchvision, which nobody asked for."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
