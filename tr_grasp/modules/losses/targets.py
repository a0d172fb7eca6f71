"""Target networks that follow the online ones."""

from __future__ import annotations

from typing import Literal

from torch.nn.modules.batchnorm import _BatchNorm
from torch.optim.swa_utils import get_ema_multi_avg_fn
from torchrl.objectives import SoftUpdate

from tr_grasp.modules.encoders.norm import copy_statistics
from tr_grasp.modules.losses.shared_encoder import SharedEncoderLoss


class TargetUpdate(SoftUpdate):
    """TorchRL's soft update of the parameters, and the encoder's running statistics as they are.

    ``SoftUpdate`` moves parameters alone, so a target encoder with batch normalisation would normalise by mean 0 and
    variance 1 for ever. The vectors of spectral normalisation are no business of this: they belong to the weights, and
    those of the target networks follow the targets' own weights with each pass.

    Args:
        loss: Its target networks are made equal to the online ones, buffers included.
        tau: Share of the online parameters that enters the target parameters at each step.
        statistics: ``initial`` leaves the running statistics as they were when the targets were made.
    """

    def __init__(
        self, loss: SharedEncoderLoss, tau: float, statistics: Literal["follow", "initial"] = "follow"
    ) -> None:
        super().__init__(loss, tau=tau)
        self._move = get_ema_multi_avg_fn(self.eps)
        # As flat lists, for TensorDict takes a millisecond to find them anew.
        names = list(self._sources.keys(True, True))
        self._online_parameters = [self._sources[name].data for name in names]
        self._target_parameters = [self._targets[("target_" + name[0], *name[1:])].data for name in names]
        keys = _statistics(loss) if statistics == "follow" else []
        self._online = loss.encoder_network_params.select(*keys)
        self._target = loss.target_encoder_network_params.select(*keys)

    def step(self) -> None:
        """Move the targets."""
        self._move(self._target_parameters, self._online_parameters, 0)
        copy_statistics(self._online, self._target)


def _statistics(loss: SharedEncoderLoss) -> list[tuple[str, ...]]:
    """Names of the buffers of the encoder's batch normalisations."""
    return [
        (*name.split("."), buffer)
        for name, layer in loss.encoder_network.named_modules()
        if isinstance(layer, _BatchNorm)
        for buffer, _ in layer.named_buffers(recurse=False)
    ]
