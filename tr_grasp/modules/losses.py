"""Truncated Quantile Critics with one encoder pass per observation and parameter set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import torch
from tensordict import TensorDictBase, TensorDictParams
from tensordict.nn import ProbabilisticTensorDictSequential, TensorDictModule, dispatch
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.objectives import TQCLoss
from torchrl.objectives.sac import compute_rsample_log_prob

from tr_grasp.keys import ACTOR_FEATURES, CRITIC_FEATURES

VALUE_FLOOR = 0.3
"""Smallest mean absolute value that the actor's loss is divided by: early values are near zero."""


class EncodedTQCLoss(TQCLoss):
    """TQC (Kuznetsov et al. 2020, arXiv:2005.04269) on the features of an encoder that actor and critics share.

    ``TQCLoss`` with the encoder inside actor and two critics would run it eight times an update; this runs it three
    times: o and o' with the online parameters, o' with the target parameters. The networks' losses are those of
    ``TQCLoss`` on encoded observations, exactly, unless a setting below says otherwise.

    Args:
        encoder_network: Reads the observation, writes one feature entry of any name.
        actor_network: Reads ``actor_features``.
        qvalue_network: Critics; they read ``critic_features`` and the action, and whatever else.
        encoder_grad: Which loss trains the encoder. The other one sees constants.
        critic_reduction: ``sum`` of the critics' losses (TorchRL) or their ``mean`` (the authors, SB3).
        normalise_actor_loss: Divide the actor's loss by the mean absolute value of its actions (at least 0.3), so
            that a second loss beside it keeps its relative weight while the values grow.
        kwargs: As for ``TQCLoss``; ``num_qvalue_nets`` follows from the list of critics.

    ``forward`` reads ``actor_features`` instead of running the encoder on o if the caller has already put them there,
    with their graph (see :meth:`encode`).
    """

    @dataclass
    class _AcceptedKeys(TQCLoss._AcceptedKeys):
        actor_features: NestedKey = ACTOR_FEATURES
        critic_features: NestedKey = CRITIC_FEATURES

    tensor_keys: _AcceptedKeys
    default_keys = _AcceptedKeys
    encoder_network: TensorDictModule
    encoder_network_params: TensorDictParams
    target_encoder_network_params: TensorDictParams
    _vmap_qnetworkN0: Callable[[TensorDictBase, TensorDictParams], TensorDictBase]

    def __init__(
        self,
        encoder_network: TensorDictModule,
        actor_network: ProbabilisticTensorDictSequential,
        qvalue_network: list[TensorDictModule],
        *,
        encoder_grad: Literal["critic", "actor", "both"] = "critic",
        critic_reduction: Literal["sum", "mean"] = "sum",
        normalise_actor_loss: bool = False,
        **kwargs: Any,
    ) -> None:
        # TQCLoss asks for its input keys before a module may be registered.
        self.__dict__["encoder_network"] = encoder_network
        super().__init__(
            actor_network, qvalue_network, num_qvalue_nets=len(qvalue_network), deactivate_vmap=True, **kwargs
        )
        self.encoder_grad = encoder_grad
        self.critic_reduction = critic_reduction
        self.normalise_actor_loss = normalise_actor_loss
        self.convert_to_functional(encoder_network, "encoder_network", create_target_params=True)
        self._in_keys = None

    def encode(self, tensordict: TensorDictBase) -> Tensor:
        """Features of an observation with the online parameters: ``(*batch, features_n)``, with their graph."""
        return self._encode(tensordict, self.encoder_network_params)

    @dispatch
    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """``loss_qvalue``, ``loss_actor``, ``loss_alpha``, ``alpha``, ``entropy``; see ``TQCLoss``."""
        keys = self.tensor_keys
        encoded = tensordict.copy()
        features = encoded.get(keys.actor_features, None)
        features = self.encode(tensordict) if features is None else features
        encoded.set(keys.actor_features, features if self.encoder_grad != "critic" else features.detach())
        encoded.set(keys.critic_features, features if self.encoder_grad != "actor" else features.detach())
        encoded.set("next", self._encode_next(tensordict.get("next")))
        losses = super().forward(encoded)
        tensordict.set(keys.priority, encoded.get(keys.priority))
        return losses

    def qvalue_v2_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Loss of the critics, summed or averaged over them; the name is TorchRL's."""
        loss, metadata = super().qvalue_v2_loss(tensordict)
        return (loss / self.num_qvalue_nets if self.critic_reduction == "mean" else loss), metadata

    def actor_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """``mean(alpha log pi - Q)``, with Q the mean over all quantiles of all critics, which stay constant."""
        with set_exploration_type(ExplorationType.RANDOM), self._online(self.actor_network, "actor_network"):
            action, log_prob = compute_rsample_log_prob(self.actor_network.get_dist(tensordict))
        critic_input = tensordict.select(*self.qvalue_network.in_keys, strict=False)
        critic_input.set(self.tensor_keys.critic_features, critic_input.get(self.tensor_keys.critic_features).detach())
        critic_input.set(self.tensor_keys.action, action)
        output = self._vmap_qnetworkN0(critic_input, self._cached_detached_qvalue_params)
        value = output.get(self.tensor_keys.state_action_value).mean(dim=(0, -1))
        loss = self._reduce_loss(self._alpha * log_prob - value, tensordict=tensordict)
        if self.normalise_actor_loss:
            loss = loss / value.detach().abs().mean().clamp(min=VALUE_FLOOR)
        return loss, {"log_prob": log_prob.detach()}

    @torch.no_grad()
    def _encode_next(self, following: TensorDictBase) -> TensorDictBase:
        """The actor at o' sees online features, the target critics those of the target encoder."""
        encoded = following.copy()
        encoded.set(self.tensor_keys.actor_features, self.encode(following))
        encoded.set(self.tensor_keys.critic_features, self._encode(following, self.target_encoder_network_params))
        return encoded

    def _encode(self, tensordict: TensorDictBase, params: TensorDictParams) -> Tensor:
        observation = tensordict.select(*self.encoder_network.in_keys)
        with params.to_module(self.encoder_network, preserve_module_state=False):
            return self.encoder_network(observation).get(self.encoder_network.out_keys[0])

    def _online(self, module: TensorDictModule, name: str) -> Any:
        return getattr(self, f"{name}_params").to_module(module, preserve_module_state=False)

    def _set_in_keys(self) -> None:
        """Observations at both ends of the transition, in place of their features."""
        super()._set_in_keys()
        features = {self.tensor_keys.actor_features, self.tensor_keys.critic_features}
        inner = features | {("next", key) for key in features}
        own = [key for key in self._in_keys or [] if key not in inner]
        both = [*self.encoder_network.in_keys, *self.qvalue_network.in_keys]
        both = [key for key in both if key not in features | {self.tensor_keys.action}]
        following = [("next", *(key if isinstance(key, tuple) else (key,))) for key in both]
        self._in_keys = list(dict.fromkeys([*own, *both, *following]))
