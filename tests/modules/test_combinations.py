"""Every pair of choices works together: networks are built and improve by one update."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, product
from pathlib import Path

import pytest
import torch

from tests.modules.transitions import transitions
from tests.toy_env import env_spec, train_cfg
from tr_grasp.configs import TrainCfg
from tr_grasp.configs.flags import parse
from tr_grasp.errors import ConfigError
from tr_grasp.keys import ACTION
from tr_grasp.modules import build_agent
from tr_grasp.trainers.learner import Learner

PICTURES = "image_cnn --env.observation.image True --replay.symmetry-augmentation False"
AXES = {
    "--encoder": ["localising_ocnn", "vanilla_ocnn", "residual_ocnn", "o_ahrnet", "point_net", "state_mlp", PICTURES],
    "--heads": ["vanilla", "dense_residual", "dueling", "advanced"],
    "--spectral-norm": ["none", "critic", "actor_critic", "all"],
    "--algorithm": ["tqc", "sac", "td3", "ddpg"],
    "--stack": ["1", "3 --shared-stack True", "3 --shared-stack False"],
    "--norm": ["none", "batch", "group", "layer"],
    "--encoder-grad": ["critic", "actor", "both"],
    "--colour": ["True", "False"],
}
WITH_NORM = {"vanilla_ocnn", "residual_ocnn", "o_ahrnet", "point_net"}
WITH_BLOCKS = {"dense_residual", "advanced"}

Choice = tuple[str, ...]


def is_allowed(choice: Choice) -> bool:
    encoder, heads, spectral_norm, _, _, norm, *_ = choice
    if encoder == PICTURES and spectral_norm == "all":
        return False
    return (norm == "none" or encoder in WITH_NORM) and (spectral_norm == "none" or heads in WITH_BLOCKS)


def pairs(choice: Choice) -> set[tuple]:
    return set(combinations(enumerate(choice), 2))


def covering() -> Iterator[Choice]:
    """Few allowed choices in which every pair of values that may meet does meet."""
    draw = random.Random(0)
    allowed = [choice for choice in product(*AXES.values()) if is_allowed(choice)]
    draw.shuffle(allowed)
    missing = set().union(*map(pairs, allowed))
    while missing:
        wanted = min(missing)
        candidates = [choice for choice in allowed if wanted in pairs(choice)][:80]
        best = max(candidates, key=lambda choice: len(pairs(choice) & missing))
        missing -= pairs(best)
        yield best


CHOICES = list(covering())


def settings(choice: Choice) -> TrainCfg:
    base = train_cfg()
    small = replace(base.network, residual_width=8, features_n=16, actor_hidden_n=(8,), critic_hidden_n=(8,))
    line = " ".join(f"{flag} {value}" for flag, value in zip(AXES, choice, strict=True))
    return parse(TrainCfg, line.split(), replace(base, network=small))


def gradients(loss: torch.Tensor, learner: Learner) -> dict[str, float]:
    """Norm of the gradient that reaches each network."""
    named = dict(learner._loss.named_parameters())
    found = torch.autograd.grad(loss, list(named.values()), retain_graph=True, allow_unused=True)
    norms: dict[str, float] = {}
    for name, gradient in zip(named, found, strict=True):
        part = name.split("_")[0]
        norms[part] = norms.get(part, 0.0) + (0.0 if gradient is None else float(gradient.norm()))
    norms["critics"] = norms.pop("qvalue", 0.0) + norms.pop("value", 0.0)
    return norms


def test_few_choices_cover_every_pair():
    allowed = [choice for choice in product(*AXES.values()) if is_allowed(choice)]
    assert set().union(*map(pairs, CHOICES)) == set().union(*map(pairs, allowed))
    assert all(map(is_allowed, CHOICES))
    for index, values in enumerate(AXES.values()):
        assert {choice[index] for choice in CHOICES} == set(values)
    assert len(CHOICES) < 50


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: "-".join(part.split()[0] for part in choice))
def test_an_update_reaches_what_it_should_and_nothing_else(choice: Choice, tmp_path: Path):
    torch.manual_seed(0)
    cfg = settings(choice)
    spec = env_spec(cfg.env)
    agent = build_agent(cfg, spec)
    learner = Learner(agent, cfg, tmp_path)
    batch = transitions(cfg, batch_n=4)
    assert agent.policy(batch.clone())[ACTION].shape == (4, spec.action_n)

    losses = learner._loss(batch.clone())
    encoder_grad = cfg.algorithm.encoder_grad
    by_critics, by_actor = gradients(losses["loss_qvalue"], learner), gradients(losses["loss_actor"], learner)
    assert (by_critics["encoder"] > 0, by_actor["encoder"] > 0) == (encoder_grad != "actor", encoder_grad != "critic")
    assert (by_critics["actor"] > 0, by_actor["actor"] > 0) == (False, True)
    assert (by_critics["critics"] > 0, by_actor["critics"] > 0) == (True, False)
    if "loss_alpha" in losses.keys():  # noqa: SIM118 -- a TensorDict iterates over its batch
        by_alpha = gradients(losses["loss_alpha"], learner)
        assert [part for part, norm in by_alpha.items() if norm > 0] == ["log"]
    assert ("loss_alpha" in losses.keys()) == cfg.algorithm.is_stochastic  # noqa: SIM118

    check_targets_follow(learner, cfg, batch)


def check_targets_follow(learner: Learner, cfg: TrainCfg, batch) -> None:
    trainable = dict(learner._loss.named_parameters())
    assert not any(name.startswith("target") for name in trainable)
    before = {name: value.clone() for name, value in learner._loss.state_dict().items() if torch.is_tensor(value)}
    learner.updates = cfg.algorithm.actor_warmup_updates * 2  # the actor's term is whole
    scalars = learner.update(batch.clone(), env_steps=0)
    assert all(value.ndim == 0 and torch.isfinite(value) for value in scalars.values()), scalars
    after = learner._loss.state_dict()
    online_moved = {name.split("_")[0] for name in trainable if not torch.equal(before[name], after[name])}
    assert {"encoder", "actor"} < online_moved
    followed = 0
    for name in trainable:
        if (target := f"target_{name}") in after:
            expected = before[target].lerp(after[name], cfg.algorithm.tau)
            torch.testing.assert_close(after[target], expected, rtol=0, atol=1e-6)
            followed += not torch.equal(before[target], after[target])
    assert followed > 4


@pytest.mark.parametrize("encoder", AXES["--encoder"])
@pytest.mark.parametrize("norm", AXES["--norm"])
def test_a_normalisation_that_an_encoder_lacks_is_refused(encoder: str, norm: str):
    cfg = settings((encoder, "vanilla", "none", "tqc", "1", norm, "critic", "True"))
    if norm == "none" or encoder in WITH_NORM:
        build_agent(cfg, env_spec(cfg.env))
        return
    with pytest.raises(ConfigError, match=rf"{encoder.split()[0]} has no option 'norm'"):
        build_agent(cfg, env_spec(cfg.env))


@pytest.mark.parametrize("heads", AXES["--heads"])
@pytest.mark.parametrize("spectral_norm", AXES["--spectral-norm"])
def test_a_spectral_norm_without_blocks_is_refused(heads: str, spectral_norm: str):
    choice = ("state_mlp", heads, spectral_norm, "tqc", "1", "none", "critic", "True")
    if spectral_norm == "none" or heads in WITH_BLOCKS:
        settings(choice)
        return
    with pytest.raises(ConfigError, match="normalises residual blocks, and heads"):
        settings(choice)


@pytest.mark.parametrize(
    ("flags", "match"),
    [
        ("--encoder image_cnn", "env.observation.image is off; choose env.observation.image True"),
        ("--encoder image_cnn --env.observation.image True", "choose replay.symmetry_augmentation False"),
        (f"--encoder {PICTURES} --demonstrations.file demos.h5", "files of demonstrations hold octrees"),
        (f"--encoder {PICTURES} --heads advanced --spectral-norm all", "choose network.spectral_norm actor_critic"),
    ],
)
def test_what_pictures_do_not_go_with_is_refused(flags: str, match: str):
    with pytest.raises(ConfigError, match=match):
        parse(TrainCfg, flags.split(), train_cfg())


def test_an_encoder_of_pictures_is_refused_where_none_are_observed():
    cfg = settings((PICTURES, "vanilla", "none", "tqc", "1", "none", "critic", "True"))
    with pytest.raises(ConfigError, match=r"image_cnn reads pictures.*turn observation.image on"):
        build_agent(cfg, replace(env_spec(cfg.env), pictures=False))


def test_options_of_other_encoders_are_refused():
    cfg = settings(("localising_ocnn", "vanilla", "none", "tqc", "1", "none", "critic", "True"))
    with pytest.raises(ConfigError, match="localising_ocnn has no option 'num_blocks'"):
        build_agent(replace(cfg, network=replace(cfg.network, num_blocks=4)), env_spec(cfg.env))
