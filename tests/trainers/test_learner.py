from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torchrl.envs.utils import ExplorationType, set_exploration_type

from tests.toy_env import env_spec, make_env, train_cfg
from tr_grasp.configs import TrainCfg
from tr_grasp.errors import TrainingDivergedError
from tr_grasp.modules import build_agent
from tr_grasp.octree import turn_action, turn_frames, turn_proprio
from tr_grasp.trainers import ReplayBuffer
from tr_grasp.trainers.batches import IMITATION_WEIGHT, BatchSampler
from tr_grasp.trainers.learner import Learner


def rollout(cfg: TrainCfg, labels: bool, seed: int = 0):
    env = replace(cfg.env, observation=replace(cfg.env.observation, expert_labels=labels))
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        return make_env(env, seed).rollout(30, break_when_any_done=False)


def setup(tmp_path, cfg: TrainCfg | None = None) -> tuple[Learner, BatchSampler]:
    torch.manual_seed(0)
    cfg = cfg or train_cfg()
    spec = env_spec(cfg.env)
    buffers = [ReplayBuffer(100, spec.stack_n) for _ in range(2)]
    buffers[0].extend(rollout(cfg, labels=True))
    buffers[1].extend(rollout(cfg, labels=False, seed=1))
    return Learner(build_agent(cfg, spec), cfg, tmp_path), BatchSampler(cfg, spec.octree, *buffers)


def weights(learner: Learner, part: str) -> dict[str, torch.Tensor]:
    state = learner.state_dict()["loss"]
    return {name: value.clone() for name, value in state.items() if name.startswith(part) and value.is_floating_point()}


def moved(before: dict[str, torch.Tensor], after: dict[str, torch.Tensor]) -> bool:
    return any(not torch.equal(before[name], after[name]) for name in before)


def test_an_update_moves_every_network_and_counts(tmp_path):
    learner, sampler = setup(tmp_path)
    learner.updates = 1  # the first one has no actor term yet
    parts = ("encoder_network", "actor_network", "qvalue_network", "log_alpha", "target_encoder", "target_qvalue")
    before = {part: weights(learner, part) for part in parts}
    scalars = learner.update(sampler.mixed(), env_steps=0)
    assert all(moved(before[part], weights(learner, part)) for part in parts)
    assert learner.updates == 2
    names = {"loss_qvalue", "loss_actor", "loss_alpha", "loss_imitation", "alpha", "entropy", "gradient_norm"}
    assert names <= set(scalars)


def test_pretraining_leaves_critics_temperature_and_targets_alone(tmp_path):
    learner, sampler = setup(tmp_path)
    parts = ("qvalue_network", "log_alpha", "target_encoder", "target_qvalue")
    before = {part: weights(learner, part) for part in parts}
    actor, encoder = weights(learner, "actor_network"), weights(learner, "encoder_network")
    learner.pretrain(sampler.demonstrations())
    assert not any(moved(before[part], weights(learner, part)) for part in parts)
    assert moved(actor, weights(learner, "actor_network"))
    assert moved(encoder, weights(learner, "encoder_network"))
    learner.synchronise_targets()
    online = weights(learner, "encoder_network")
    target = weights(learner, "target_encoder_network")
    assert all(torch.equal(value, target[f"target_{name}"]) for name, value in online.items())


def test_pretraining_learns_to_act_like_the_expert(tmp_path):
    learner, sampler = setup(tmp_path)
    losses = [float(learner.pretrain(sampler.demonstrations())["loss_imitation"]) for _ in range(60)]
    assert sum(losses[-10:]) < 0.6 * sum(losses[:10])


def test_imitation_alone_leaves_the_critics_alone(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, imitation=replace(cfg.imitation, reinforcement=False))
    learner, sampler = setup(tmp_path, cfg)
    before = weights(learner, "qvalue_network")
    scalars = learner.update(sampler.mixed(), env_steps=0)
    assert not moved(before, weights(learner, "qvalue_network"))
    assert "loss_qvalue" not in scalars


def test_the_actors_reinforcement_is_warmed_up(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, imitation=replace(cfg.imitation, weight_initial=0.0, weight_final=0.0))
    learner, sampler = setup(tmp_path, cfg)
    before = weights(learner, "actor_network")
    learner.update(sampler.mixed(), env_steps=0)
    assert not moved(before, weights(learner, "actor_network"))
    learner.update(sampler.mixed(), env_steps=0)
    assert moved(before, weights(learner, "actor_network"))


def test_td3_improves_actor_and_targets_in_every_second_update(tmp_path):
    cfg = train_cfg()
    cfg = replace(
        cfg,
        imitation=replace(cfg.imitation, weight_initial=0.0, weight_final=0.0),
        algorithm=replace(cfg.algorithm, name="td3", actor_warmup_updates=0),
    )
    learner, sampler = setup(tmp_path, cfg)
    moves = []
    for _ in range(4):
        before = {part: weights(learner, part) for part in ("actor", "target_actor", "target_qvalue", "qvalue")}
        learner.update(sampler.mixed(), env_steps=0)
        moves.append([moved(before[part], weights(learner, part)) for part in before])
    assert moves == [[True] * 4, [False, False, False, True]] * 2


def test_gradients_are_clipped(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, optimiser=replace(cfg.optimiser, gradient_clip=1e-9))
    learner, sampler = setup(tmp_path, cfg)
    assert learner.update(sampler.mixed(), 0)["gradient_norm"] > 1e-3
    gradients = [p.grad for n, p in learner._loss.named_parameters() if n != "log_alpha" and p.grad is not None]
    assert torch.stack([g.norm() for g in gradients]).norm() < 1.1e-9


def test_the_learning_rate_follows_the_run(tmp_path):
    learner, sampler = setup(tmp_path)
    end = train_cfg().trainer.env_steps
    first, last = (learner.update(sampler.mixed(), steps)["learning_rate"] for steps in (0, end))
    torch.testing.assert_close(last, 0.1 * first)


def test_a_loss_that_is_not_finite_stops_before_it_harms_and_keeps_the_batch(tmp_path):
    learner, sampler = setup(tmp_path)
    batch = sampler.mixed()
    batch["next", "reward"][0] = float("nan")
    before = weights(learner, "")
    with pytest.raises(TrainingDivergedError, match=r"loss_qvalue nan.*diverged_batch\.pt"):
        learner.update(batch, env_steps=0)
    assert not moved(before, weights(learner, ""))
    kept = torch.load(tmp_path / "diverged_batch.pt", weights_only=True)
    assert torch.isnan(kept["batch"]["next"]["reward"][0]).all()


def test_a_restored_learner_goes_on_exactly(tmp_path):
    cfg = train_cfg()
    learner, sampler = setup(tmp_path, cfg)
    for _ in range(3):
        learner.update(sampler.mixed(), env_steps=0)
    torch.save(learner.state_dict(), tmp_path / "learner.pt")
    other = Learner(build_agent(cfg, env_spec(cfg.env)), cfg, tmp_path)
    other.load_state_dict(torch.load(tmp_path / "learner.pt", weights_only=True))
    batches = [sampler.mixed() for _ in range(3)]
    for each in (learner, other):
        torch.manual_seed(5)
        for batch in batches:
            each.update(batch.clone(), env_steps=0)
    assert not moved(weights(learner, ""), weights(other, ""))
    assert all(torch.equal(a, b) for a, b in zip(learner.agent.parameters(), other.agent.parameters(), strict=True))


def test_a_batch_is_half_demonstrations_and_only_they_are_imitated(tmp_path):
    _, sampler = setup(tmp_path)
    batch = sampler.mixed()
    assert batch[IMITATION_WEIGHT].tolist() == [1.0] * 4 + [0.0] * 4
    assert batch["expert_action"][:4].any(dim=1).all()
    assert not batch["expert_action"][4:].any()


def test_rewards_are_scaled_for_the_learner_only(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, algorithm=replace(cfg.algorithm, reward_scale=0.5))
    _, sampler = setup(tmp_path, cfg)
    stored = sampler._experience.get(torch.arange(30))["next", "reward"]
    assert set(sampler.mixed()["next", "reward"][4:].flatten().tolist()) <= set((0.5 * stored).flatten().tolist())


def test_an_episode_that_ran_out_of_time_ends_all_reward_where_that_is_wanted(tmp_path):
    cfg = train_cfg()

    def flags(timeout: str) -> torch.Tensor:
        _, sampler = setup(tmp_path, replace(cfg, replay=replace(cfg.replay, timeout=timeout, batch_size=64)))
        following = sampler.mixed()["next"]
        return torch.stack([following["terminated"], following["truncated"]])

    terminated, truncated = flags("bootstrap")
    assert (truncated & ~terminated).any()
    assert torch.equal(flags("terminal")[0], terminated | truncated)


def test_both_ends_of_a_transition_are_turned_by_the_same_element(tmp_path):
    cfg = train_cfg()
    _, plain = setup(tmp_path, replace(cfg, replay=replace(cfg.replay, symmetry_augmentation=False)))
    _, turned = setup(tmp_path, cfg)
    before, after = plain.mixed(), turned.mixed()
    elements = torch.Generator().manual_seed(cfg.seed)
    for n in (4, 4):
        torch.randint(0, 30, (n,), generator=elements)
    elements = torch.randint(8, (8,), generator=elements)
    spec = env_spec(cfg.env).octree
    for part_before, part_after in ((before, after), (before["next"], after["next"])):
        assert torch.equal(part_after["octree"].codes, turn_frames(elements, part_before["octree"], spec).codes)
        assert torch.equal(part_after["proprio"], turn_proprio(elements, part_before["proprio"], spec))
    for name in ("action", "expert_action"):
        assert torch.equal(after[name], turn_action(elements, before[name]))
    assert not torch.equal(after["proprio"], before["proprio"])


def test_the_average_is_the_running_mean_of_the_weights_after_each_update(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, optimiser=replace(cfg.optimiser, averaging=0.9))
    learner, sampler = setup(tmp_path, cfg)
    expected = None
    for _ in range(3):
        learner.update(sampler.mixed(), env_steps=0)
        latest = [p.detach().double().clone() for p in learner.agent.parameters()]
        expected = latest if expected is None else [0.9 * e + 0.1 * p for e, p in zip(expected, latest, strict=True)]
    for average, mean in zip(learner.average.parameters(), expected, strict=True):
        torch.testing.assert_close(average.double(), mean, rtol=1e-6, atol=1e-6)


def test_without_averaging_the_latest_weights_are_judged(tmp_path):
    cfg = train_cfg()
    cfg = replace(cfg, optimiser=replace(cfg.optimiser, averaging=0.0))
    learner, sampler = setup(tmp_path, cfg)
    for _ in range(2):
        learner.update(sampler.mixed(), env_steps=0)
    for average, latest in zip(learner.average.parameters(), learner.agent.parameters(), strict=True):
        assert torch.equal(average, latest)
