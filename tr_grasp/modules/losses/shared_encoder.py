"""One encoder pass per observation and parameter set, whatever the algorithm."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar, Literal

import torch
from tensordict import TensorDictBase, TensorDictParams
from tensordict.nn import TensorDictModule, dispatch
from torch import Tensor, nn
from torch.nn.modules.batchnorm import _BatchNorm
from torchrl.objectives import LossModule

from tr_grasp.keys import ACTION, ACTOR_FEATURES, CRITIC_FEATURES

EncoderGrad = Literal["critic", "actor", "both"]

VALUE_FLOOR = 0.3
"""Smallest mean absolute value that the actor's loss is divided by: early values are near zero."""


class SharedEncoderLoss(LossModule):
    """Goes before one of TorchRL's losses in a class' bases and hands it features instead of observations.

    TorchRL's losses see networks that read ``actor_features`` or ``critic_features``; observations are encoded before,
    o and o' with the online parameters, o' with the target parameters. With the encoder inside actor and two critics,
    TQC would run it eight times an update, not three times.

    Passes over o' need no gradient. Batch normalisation uses its running statistics in them, so that only what the
    losses are taken on moves these; :class:`TargetUpdate` brings them to the target encoder.

    Args:
        encoder_network: Reads the observation, writes one feature entry of any name.
        actor_network: Reads ``actor_features``.
        critics: What the algorithm takes; they read ``critic_features`` and the action, and whatever else.
        encoder_grad: Which loss trains the encoder. The other one sees constants.
        critic_reduction: ``sum`` of the critics' losses (TorchRL) or their ``mean`` (the authors of TQC, SB3).
        normalise_actor_loss: Divide the actor's loss by the mean absolute value of its actions (at least 0.3), so
            that a second loss beside it keeps its relative weight while the values grow.
        kwargs: As for TorchRL's loss.

    ``forward`` reads ``actor_features`` instead of running the encoder on o if the caller has already put them there,
    with their graph (see :meth:`encode`).
    """

    critic_name: ClassVar[str] = "qvalue_network"
    """TorchRL's name of the critics."""

    acts_by_target: ClassVar[bool] = False
    """At o' acts a target actor, on the target encoder's features."""

    num_qvalue_nets: int
    encoder_network: TensorDictModule
    encoder_network_params: TensorDictParams
    target_encoder_network_params: TensorDictParams

    def __init__(
        self,
        encoder_network: TensorDictModule,
        actor_network: TensorDictModule,
        critics: Any,
        *,
        encoder_grad: EncoderGrad = "critic",
        critic_reduction: Literal["sum", "mean"] = "sum",
        normalise_actor_loss: bool = False,
        **kwargs: Any,
    ) -> None:
        # TorchRL's losses ask for their input keys before a module may be registered.
        self.__dict__["encoder_network"] = encoder_network
        super().__init__(actor_network, critics, **kwargs)
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
        """Scalars: ``loss_qvalue``, ``loss_actor``, and what else the algorithm has in ``out_keys``."""
        encoded = self._without_observation(tensordict)
        features = encoded.get(ACTOR_FEATURES, None)
        features = self.encode(tensordict) if features is None else features
        encoded.set(ACTOR_FEATURES, features if self.encoder_grad != "critic" else features.detach())
        encoded.set(CRITIC_FEATURES, features if self.encoder_grad != "actor" else features.detach())
        encoded.set("next", self._encode_next(tensordict.get("next")))
        losses = super().forward(encoded)
        tensordict.set(self.tensor_keys.priority, encoded.get(self.tensor_keys.priority))
        return losses.select(*self.out_keys)

    def _encode(self, tensordict: TensorDictBase, params: TensorDictParams) -> Tensor:
        observation = tensordict.select(*self.encoder_network.in_keys)
        with params.to_module(self.encoder_network, preserve_module_state=False):
            return self.encoder_network(observation).get(self.encoder_network.out_keys[0])

    @torch.no_grad()
    def _encode_next(self, following: TensorDictBase) -> TensorDictBase:
        """Critics at o' are target critics and see the target encoder's features; so does a target actor."""
        encoded = self._without_observation(following)
        with _frozen_statistics(self.encoder_network):
            target = self._encode(following, self.target_encoder_network_params)
            encoded.set(CRITIC_FEATURES, target)
            encoded.set(ACTOR_FEATURES, target if self.acts_by_target else self.encode(following))
        return encoded

    def _without_observation(self, tensordict: TensorDictBase) -> TensorDictBase:
        """A shallow copy of what the losses read, for TorchRL copies all of it."""
        return tensordict.exclude(*self.encoder_network.in_keys)

    def _reduce_over_critics(self, loss: Tensor) -> Tensor:
        """TorchRL sums over the critics."""
        return loss / self.num_qvalue_nets if self.critic_reduction == "mean" else loss

    def _normalise(self, actor_loss: Tensor, values: Tensor) -> Tensor:
        if not self.normalise_actor_loss:
            return actor_loss
        return actor_loss / values.detach().abs().mean().clamp(min=VALUE_FLOOR)

    def _set_in_keys(self) -> None:
        """Observations at both ends of the transition, in place of their features."""
        super()._set_in_keys()
        inner = {key for name in (ACTOR_FEATURES, CRITIC_FEATURES) for key in (name, ("next", name))}
        read = [*self.encoder_network.in_keys, *getattr(self, self.critic_name).in_keys]
        following = [("next", *(key if isinstance(key, tuple) else (key,))) for key in read if key != ACTION]
        wanted = [*(self._in_keys or []), *read, *following]
        self._in_keys = [key for key in dict.fromkeys(wanted) if key not in inner]


def constant_critic_features(tensordict: TensorDictBase) -> TensorDictBase:
    """What an actor's loss may see: it trains the encoder through the actor, never through the critics."""
    return tensordict.copy().set(CRITIC_FEATURES, tensordict.get(CRITIC_FEATURES).detach())


@contextmanager
def _frozen_statistics(module: nn.Module) -> Iterator[None]:
    """Batch normalisation by running statistics; everything else stays in the mode that it is in."""
    normalisers = [layer for layer in module.modules() if isinstance(layer, _BatchNorm) and layer.training]
    for layer in normalisers:
        layer.eval()
    try:
        yield
    finally:
        for layer in normalisers:
            layer.train()
