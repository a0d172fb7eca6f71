"""A policy and its dense twin, in memory, as a torch.export file and as ONNX."""

from __future__ import annotations

import io
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.toy_env import env_spec, train_cfg, with_pictures
from tr_grasp.configs import TrainCfg
from tr_grasp.errors import CheckpointError, ExportError, StorageError
from tr_grasp.modules import Agent, build_agent, load_agent, save_policy
from tr_grasp.modules.export import (
    TOLERANCE,
    DensePolicy,
    Observations,
    as_runner,
    export_onnx,
    export_policy,
    export_torch,
    exportable_encoders,
    formats,
    measure_parity,
    open_onnx,
    open_torch,
    random_observations,
    write,
)
from tr_grasp.modules.heads import SpectralNorm
from tr_grasp.octree import OctreeFrame
from tr_grasp.provenance import Provenance

FROM = Provenance("tr-grasp export panda", "abc123")


def make(encoder: str = "localising_ocnn", **network: object) -> tuple[Agent, TrainCfg]:
    base = train_cfg()
    cfg = replace(base, network=replace(base.network, encoder=encoder, **network))
    torch.manual_seed(0)
    return build_agent(cfg, env_spec(cfg.env)).eval().requires_grad_(False), cfg


def disturb_statistics(agent: Agent) -> None:
    """Batch normalisation that does something."""
    for name, buffer in agent.named_buffers():
        if name.endswith("running_mean"):
            buffer.copy_(0.1 * torch.randn_like(buffer))
        elif name.endswith("running_var"):
            buffer.copy_(0.5 + torch.rand_like(buffer))


@torch.no_grad()
def difference(agent: Agent, observations: Observations) -> float:
    return float((DensePolicy(agent)(*observations) - as_runner(agent)(*observations)).abs().max())


@pytest.mark.parametrize(
    ("encoder", "network"),
    [
        ("localising_ocnn", {}),
        ("vanilla_ocnn", {"node_set": "siblings", "shared_stack": False}),
        ("vanilla_ocnn", {"norm": "batch"}),
        ("residual_ocnn", {"norm": "group", "heads": "advanced", "spectral_norm": "all", "residual_width": 8}),
        ("o_ahrnet", {"norm": "layer"}),
        ("point_net", {"norm": "batch"}),
    ],
)
def test_the_dense_twin_acts_like_the_policy(encoder: str, network: dict[str, object]) -> None:
    agent, _ = make(encoder, **network)
    disturb_statistics(agent)
    assert difference(agent, random_observations(agent.env_spec, 12)) <= TOLERANCE


@torch.no_grad()
def test_the_shipped_policy_and_its_twin_agree_on_a_thousand_observations() -> None:
    agent = load_agent("panda")[0].eval()
    observations = random_observations(agent.env_spec, 1_000)
    actions = as_runner(agent)(*observations)
    assert actions.std(0).min() > 0.1  # they are not all the same
    for start in range(0, 1_000, 100):
        rows = observations.rows(start, start + 100)
        assert (DensePolicy(agent)(*rows) - actions[start : start + 100]).abs().max() <= TOLERANCE


@settings(max_examples=5)
@given(stack_n=st.integers(1, 3), depth=st.integers(3, 5), colour=st.booleans(), seed=st.integers(0, 1_000))
def test_the_twin_fits_any_observation(stack_n: int, depth: int, colour: bool, seed: int) -> None:
    cfg = train_cfg()
    seen = replace(cfg.env.observation, stack_n=stack_n, depth=depth, colour=colour)
    torch.manual_seed(seed)
    agent = build_agent(cfg, env_spec(replace(cfg.env, observation=seen))).eval()
    assert difference(agent, random_observations(agent.env_spec, 4, seed)) <= TOLERANCE


def test_a_twin_of_other_weights_is_told_from_the_policy() -> None:
    agent, _ = make()
    other, _ = make(heads="dense_residual")
    observations = random_observations(agent.env_spec, 6)
    parity = measure_parity(agent, DensePolicy(other), observations)
    by_hand = (DensePolicy(other)(*observations) - as_runner(agent)(*observations)).abs().max()
    assert parity.largest_difference == pytest.approx(float(by_hand), abs=TOLERANCE)
    assert parity.largest_difference > 0.01
    assert parity.observations_n == 6


def test_exporting_leaves_the_agent_as_it_was() -> None:
    agent, _ = make("residual_ocnn", heads="advanced", spectral_norm="all", residual_width=8)
    before = {name: value.clone() for name, value in agent.state_dict().items()}
    twin = DensePolicy(agent.train())
    assert agent.training
    assert not twin.training
    assert {encoder.backend for encoder in agent.encoder.module.encoder.encoders} == {"sparse"}
    assert any(isinstance(module, SpectralNorm) for module in twin.modules())
    twin(*random_observations(agent.env_spec, 2))
    assert all(torch.equal(value, before[name]) for name, value in agent.state_dict().items())


def test_random_observations_are_such_as_a_camera_makes() -> None:
    agent, _ = make()
    codes, features, proprio = random_observations(agent.env_spec, 100)
    frames = OctreeFrame.unoccupied(agent.env_spec.octree, (100, 2))
    assert (codes.shape, codes.dtype) == (frames.codes.shape, frames.codes.dtype)
    assert (features.shape, features.dtype) == (frames.features.shape, frames.features.dtype)
    leaves_n = (codes >= 0).sum(-1)
    assert leaves_n.min() == 0
    assert leaves_n.max() == agent.env_spec.octree.leaf_capacity
    x, y = proprio[..., 4:7], proprio[..., 7:10]
    torch.testing.assert_close(torch.linalg.cross(x, y)[..., 2], -torch.ones(100, 2))  # the tool looks down
    again = random_observations(agent.env_spec, 100)
    assert torch.equal(codes, again.codes)


def test_a_torch_file_acts_alike_for_any_batch_and_says_what_it_is() -> None:
    agent, _ = make("vanilla_ocnn", norm="batch")
    content = export_torch(DensePolicy(agent), {"depth": "4"})
    parity = measure_parity(agent, open_torch(content), random_observations(agent.env_spec, 10))
    assert parity.largest_difference <= TOLERANCE
    files = {formats.DESCRIPTION_FILE: ""}
    torch.export.load(io.BytesIO(content), extra_files=files)
    assert json.loads(files[formats.DESCRIPTION_FILE]) == {"depth": "4"}


def test_an_onnx_file_acts_alike_for_any_batch_and_says_what_it_is(tmp_path) -> None:
    onnx = pytest.importorskip("onnx")
    runtime = pytest.importorskip("onnxruntime")
    agent, cfg = make()
    save_policy(tmp_path / "policy", agent, cfg, {"command": "tr-grasp train smoke", "commit": "def456"})
    exported = export_policy(tmp_path / "policy", tmp_path / "new" / "policy.onnx", FROM, observations_n=10)
    assert exported.parity.largest_difference <= TOLERANCE
    assert exported.size_bytes == exported.path.stat().st_size
    onnx.checker.check_model(onnx.load(exported.path), full_check=True)

    session = runtime.InferenceSession(exported.path, providers=["CPUExecutionProvider"])
    described = [(x.name, x.type, x.shape) for x in (*session.get_inputs(), *session.get_outputs())]
    assert described == [
        ("codes", "tensor(int16)", ["batch", 2, 32]),
        ("features", "tensor(float16)", ["batch", 2, 32, 7]),
        ("proprio", "tensor(float)", ["batch", 2, 10]),
        ("action", "tensor(float)", ["batch", 5]),
    ]
    facts = session.get_modelmeta().custom_metadata_map
    octree = agent.env_spec.octree
    assert np.allclose(json.loads(facts["origin_m"]), octree.origin_m)
    assert [json.loads(facts[name]) for name in ("side_m", "depth", "stack_n")] == [octree.side_m, octree.depth, 2]
    assert facts["features"] == "normal_x, normal_y, normal_z, distance, red, green, blue"
    assert facts["training_commit"] == "def456"
    assert (facts["export_command"], facts["export_commit"]) == ("tr-grasp export panda", "abc123")


@pytest.mark.slow
@pytest.mark.parametrize("encoder", ["vanilla_ocnn", "residual_ocnn", "o_ahrnet", "point_net"])
def test_every_encoder_acts_alike_in_onnx(encoder: str) -> None:
    pytest.importorskip("onnxscript")
    agent, _ = make(encoder)
    run = open_onnx(export_onnx(DensePolicy(agent), {}))
    assert measure_parity(agent, run, random_observations(agent.env_spec, 20)).largest_difference <= TOLERANCE


@pytest.mark.slow
@pytest.mark.parametrize("format", ["onnx", "torch"])
def test_the_exported_shipped_policy_acts_alike_on_a_thousand_observations(tmp_path, format) -> None:
    exported = export_policy("panda", tmp_path / "panda", FROM, format=format, observations_n=1_000)
    assert exported.parity.largest_difference <= TOLERANCE


def test_an_encoder_without_a_dense_backend_is_refused_by_name() -> None:
    assert exportable_encoders() == ["localising_ocnn", "o_ahrnet", "point_net", "residual_ocnn", "vanilla_ocnn"]
    with pytest.raises(
        ExportError, match=r"encoder state_mlp cannot be exported.*localising_ocnn, o_ahrnet, point_net"
    ):
        DensePolicy(make("state_mlp")[0])
    cfg = with_pictures(train_cfg())
    with pytest.raises(ExportError, match="encoder image_cnn cannot be exported"):
        DensePolicy(build_agent(cfg, env_spec(cfg.env)))


@pytest.mark.parametrize("package", ["onnx", "onnxscript", "onnxruntime"])
def test_a_missing_package_is_named_with_its_cure(tmp_path, monkeypatch, package: str) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ExportError, match=rf"need the package {package}: pip install 'tr-grasp\[export\]'"):
        export_policy("panda", tmp_path / "panda.onnx", FROM)
    assert not (tmp_path / "panda.onnx").exists()


def test_a_file_that_acts_otherwise_is_not_written(tmp_path, monkeypatch) -> None:
    agent, cfg = make()
    save_policy(tmp_path / "policy", agent, cfg, {})
    other = DensePolicy(make(heads="dense_residual")[0])
    monkeypatch.setattr(write, "DensePolicy", lambda _: other)
    monkeypatch.setattr(write, "export_torch", lambda *_: b"")
    monkeypatch.setattr(write, "open_torch", lambda _: other)
    (tmp_path / "policy.pt2").write_text("old")
    with pytest.raises(ExportError, match="so nothing was written"):
        export_policy(tmp_path / "policy", tmp_path / "policy.pt2", FROM, format="torch", observations_n=3)
    assert (tmp_path / "policy.pt2").read_text() == "old"


def test_a_target_that_cannot_be_written_is_named_before_the_work(tmp_path) -> None:
    with pytest.raises(StorageError, match="it is a folder"):
        export_policy("panda", tmp_path, FROM, format="torch")
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="could not make the folder"):
        export_policy("panda", tmp_path / "file" / "panda.pt2", FROM, format="torch")


def test_an_unknown_policy_is_named(tmp_path) -> None:
    with pytest.raises(CheckpointError, match="unknown policy 'pandda'; did you mean 'panda'"):
        export_policy("pandda", tmp_path / "panda.pt2", FROM, format="torch")
