"""Algorithms whose policy is random and is paid for its entropy: TQC and SAC."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tensordict import TensorDictBase, TensorDictParams
from tensordict.nn import ProbabilisticTensorDictSequential, TensorDictModule
from torch import Tensor
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.objectives import SACLoss, TQCLoss
from torchrl.objectives.sac import compute_rsample_log_prob

from tr_grasp.modules.losses.shared_encoder import SharedEncoderLoss, constant_critic_features


class _EntropyLoss(SharedEncoderLoss):
    """What TQC and SAC share; see :class:`SharedEncoderLoss` for the arguments."""

    actor_network: ProbabilisticTensorDictSequential
    actor_network_params: TensorDictParams
    qvalue_network: TensorDictModule
    _alpha: Tensor
    _cached_detached_qvalue_params: TensorDictParams
    _vmap_qnetworkN0: Callable[[TensorDictBase, TensorDictParams], TensorDictBase]

    def __init__(
        self,
        encoder_network: TensorDictModule,
        actor_network: ProbabilisticTensorDictSequential,
        qvalue_network: list[TensorDictModule],
        **kwargs: Any,
    ) -> None:
        critics_n = len(qvalue_network)
        super().__init__(
            encoder_network, actor_network, qvalue_network, num_qvalue_nets=critics_n, deactivate_vmap=True, **kwargs
        )

    def qvalue_v2_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the critics, summed or averaged over them; the name is TorchRL's."""
        loss, metadata = super().qvalue_v2_loss(tensordict)
        return self._reduce_over_critics(loss), metadata

    def actor_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """``mean(alpha log pi - Q)``; the critics stay constant."""
        online = self.actor_network_params.to_module(self.actor_network, preserve_module_state=False)
        with set_exploration_type(ExplorationType.RANDOM), online:
            action, log_prob = compute_rsample_log_prob(self.actor_network.get_dist(tensordict))
        critic_input = constant_critic_features(tensordict).select(*self.qvalue_network.in_keys, strict=False)
        critic_input.set(self.tensor_keys.action, action)
        output = self._vmap_qnetworkN0(critic_input, self._cached_detached_qvalue_params)
        value = self._value(output.get(self.tensor_keys.state_action_value))
        loss = self._reduce_loss(self._alpha * log_prob - value, tensordict=tensordict)
        return self._normalise(loss, value), {"log_prob": log_prob.detach()}

    def _value(self, estimates: Tensor) -> Tensor:
        """What the actor climbs, ``(*batch,)``, of the critics' outputs ``(critics, *batch, quantiles)``."""
        raise NotImplementedError


class EncodedTQCLoss(_EntropyLoss, TQCLoss):
    """Truncated Quantile Critics on the features of a shared encoder.

    The losses are those of ``TQCLoss`` on encoded observations, exactly, unless a setting of
    :class:`SharedEncoderLoss` says otherwise. The actor climbs the mean over all quantiles of all critics.

    Source: Kuznetsov et al. 2020, arXiv:2005.04269.
    """

    def _value(self, estimates: Tensor) -> Tensor:
        return estimates.mean(dim=(0, -1))


class EncodedSACLoss(_EntropyLoss, SACLoss):
    """Soft Actor-Critic on the features of a shared encoder; the critics' outputs have width 1.

    The losses are those of ``SACLoss`` on encoded observations, exactly. The actor climbs the smallest critic.

    Source: Haarnoja et al. 2018, arXiv:1812.05905.
    """

    def _value(self, estimates: Tensor) -> Tensor:
        return estimates.amin(0).squeeze(-1)
