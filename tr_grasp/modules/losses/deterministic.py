"""Algorithms whose policy is deterministic and has a target network of its own: TD3 and DDPG."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from tensordict import TensorDictBase
from tensordict.nn import TensorDictModule, TensorDictModuleBase
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.objectives import DDPGLoss, TD3Loss, distance_loss

from tr_grasp.modules.losses.shared_encoder import SharedEncoderLoss, constant_critic_features


class EncodedTD3Loss(SharedEncoderLoss, TD3Loss):
    """Twin Delayed DDPG on the features of a shared encoder.

    The losses are those of ``TD3Loss`` on encoded observations, exactly, unless a setting of
    :class:`SharedEncoderLoss` says otherwise; updating the actor less often is the learner's business. The actor climbs
    the first critic.

    Source: Fujimoto et al. 2018, arXiv:1802.09477.
    """

    acts_by_target = True
    out_keys = ["loss_actor", "loss_qvalue"]  # noqa: RUF012 -- as in TorchRL

    def __init__(
        self,
        encoder_network: TensorDictModule,
        actor_network: TensorDictModule,
        qvalue_network: list[TensorDictModule],
        **kwargs: Any,
    ) -> None:
        critics_read = [key for key in qvalue_network[0].in_keys if key not in actor_network.out_keys]
        super().__init__(
            encoder_network,
            _ActorWithContext(actor_network, critics_read),
            qvalue_network,
            num_qvalue_nets=len(qvalue_network),
            deactivate_vmap=True,
            **kwargs,
        )

    def value_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the critics, summed or averaged over them; the name is TorchRL's."""
        loss, metadata = super().value_loss(tensordict)
        return self._reduce_over_critics(loss), metadata

    def actor_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """``-mean(Q)`` of the first critic, which stays constant."""
        loss, metadata = super().actor_loss(constant_critic_features(tensordict))
        return self._normalise(loss, metadata["state_action_value_actor"][0]), metadata


class EncodedDDPGLoss(SharedEncoderLoss, DDPGLoss):
    """Deep Deterministic Policy Gradient on the features of a shared encoder.

    ``DDPGLoss`` cuts the graph of what its networks read, so no loss of it could train an encoder. Its two losses are
    written again here without that cut; their values are the same, and targets, value estimator and parameters are
    TorchRL's.

    Source: Lillicrap et al. 2016, arXiv:1509.02971.
    """

    critic_name = "value_network"
    acts_by_target = True
    out_keys = ["loss_actor", "loss_qvalue"]  # noqa: RUF012 -- as in TorchRL

    def __init__(
        self,
        encoder_network: TensorDictModule,
        actor_network: TensorDictModule,
        qvalue_network: list[TensorDictModule],
        **kwargs: Any,
    ) -> None:
        (critic,) = qvalue_network
        super().__init__(encoder_network, actor_network, critic, delay_actor=True, **kwargs)

    def loss_value(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the critic; the name is TorchRL's."""
        value = self._value(tensordict, self.value_network_params)
        target = self.value_estimator.value_estimate(tensordict, target_params=self._cached_target_params).squeeze(-1)
        tensordict.set(self.tensor_keys.priority, (value - target).pow(2).detach())
        loss = self._reduce_loss(distance_loss(value, target, self.loss_function), tensordict=tensordict)
        return loss, {"loss_qvalue": loss}

    def loss_actor(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """``-mean(Q)``; the critic stays constant. The name is TorchRL's."""
        acting = constant_critic_features(tensordict)
        with self.actor_network_params.to_module(self.actor_network, preserve_module_state=False):
            acting = self.actor_network(acting)
        value = self._value(acting, self._cached_detached_value_params)
        return self._normalise(self._reduce_loss(-value, tensordict=tensordict), value), {}

    def _value(self, tensordict: TensorDictBase, params: Any) -> Tensor:
        read = tensordict.select(*self.value_network.in_keys, strict=False)
        with params.to_module(self.value_network, preserve_module_state=False):
            return self.value_network(read).get(self.tensor_keys.state_action_value).squeeze(-1)


class _ActorWithContext(TensorDictModuleBase):
    """An actor that names what critics read among its own inputs: ``TD3Loss`` hands them nothing else."""

    def __init__(self, actor: TensorDictModule, critics_read: Iterable[NestedKey]) -> None:
        super().__init__()
        self.actor = actor
        self.in_keys = list(dict.fromkeys([*actor.in_keys, *critics_read]))
        self.out_keys = actor.out_keys

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        return self.actor(tensordict)
