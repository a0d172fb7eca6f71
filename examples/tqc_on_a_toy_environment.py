"""TQC without a robot: points in a square learn to go to the middle."""

from __future__ import annotations

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModule as Module
from torchrl.data import Bounded, Composite, Unbounded
from torchrl.envs import EnvBase, ExplorationType
from torchrl.modules import ProbabilisticActor, TanhNormal, ValueOperator

from tr_grasp.modules import EncodedTQCLoss, GaussianActor, QuantileCritic, TargetUpdate


class ToTheMiddle(EnvBase):
    """32 points that never stop; the reward is minus the distance from the middle."""

    def __init__(self) -> None:
        super().__init__(batch_size=[32])
        self.observation_spec = Composite(place=Unbounded((32, 2)), shape=[32])
        self.action_spec, self.reward_spec = Bounded(-1, 1, (32, 2)), Unbounded((32, 1))

    def _reset(self, tensordict: TensorDictBase | None = None, **_: object) -> TensorDictBase:
        return TensorDict({"place": torch.rand(32, 2) * 2 - 1}, [32])

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        place = (tensordict["place"] + 0.3 * tensordict["action"]).clamp(-1, 1)
        reward, never = -place.norm(dim=1, keepdim=True), torch.zeros(32, 1, dtype=torch.bool)
        return TensorDict({"place": place, "reward": reward, "done": never}, [32])

    def _set_seed(self, seed: int) -> None:
        torch.manual_seed(seed)


def main(rounds: int = 20, updates_n: int = 20) -> list[float]:
    """Mean reward in each round of ten steps and some updates."""
    env, memory = ToTheMiddle(), []
    env.set_seed(0)
    encoder = Module(torch.nn.Linear(2, 32), ["place"], ["actor_features"])
    head = Module(GaussianActor(32, 2), ["actor_features"], ["loc", "scale"])
    explore = {"distribution_class": TanhNormal, "default_interaction_type": ExplorationType.RANDOM}
    actor = ProbabilisticActor(head, ["loc", "scale"], **explore)
    critics = [ValueOperator(QuantileCritic(32, 2), ["critic_features", "action"]) for _ in range(2)]
    loss = EncodedTQCLoss(encoder, actor, critics, top_quantiles_to_drop_per_net=2, alpha_init=0.05, target_entropy=-4)
    loss.make_value_estimator(gamma=0.9)
    targets, optimiser = TargetUpdate(loss, tau=0.05), torch.optim.Adam(loss.parameters(), lr=3e-3)
    for _ in range(rounds):
        memory.append(env.rollout(10, lambda td: actor(encoder(td))).detach().reshape(-1))
        for _ in range(updates_n):
            losses = loss(torch.cat(memory)[torch.randint(320 * len(memory), (128,))])
            optimiser.zero_grad()
            (losses["loss_qvalue"] + losses["loss_actor"] + losses["loss_alpha"]).backward()
            optimiser.step()
            targets.step()
    return [steps["next", "reward"].mean().item() for steps in memory]


if __name__ == "__main__":
    print("mean reward of each round:", *(f"{reward:.2f}" for reward in main()))
