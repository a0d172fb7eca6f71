"""The thesis' networks as predictors: fed evenly, asked at any horizon."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from tr_grasp.errors import CheckpointError
from tr_grasp.prediction.networks import PERIOD_S, WINDOW_N, MotionLSTM, MotionMLP
from tr_grasp.prediction.predictor import Array, Extrapolation, GateCfg, Predictor
from tr_grasp.prediction.weights import fill, load_weights
from tr_grasp.prediction.window import Window, even_times
from tr_grasp.prediction.yaw import YawTracker

LONGEST_GAP_S = 5.0


@dataclass(frozen=True)
class HeadsCfg:
    """What the outputs of a network of the thesis mean."""

    ahead_s: tuple[float, float]
    """Times after the newest input for which it predicts; the thesis' training makes that 1.2 and 2.2 s."""
    sigma_m: tuple[float, float]
    """Root mean square errors of those outputs on validation data, an axis."""

    @staticmethod
    def read(settings: dict[str, Any], source: str | Path) -> HeadsCfg:
        """From the settings of saved weights.

        Raises:
            CheckpointError: They are something else.
        """
        try:
            (near, far), (near_sigma, far_sigma) = settings["ahead_s"], settings["sigma_m"]
            cfg = HeadsCfg((float(near), float(far)), (float(near_sigma), float(far_sigma)))
        except (KeyError, TypeError, ValueError) as error:
            raise CheckpointError(f"the weights '{source}' do not say what they predict.") from error
        if not (0 < cfg.ahead_s[0] < cfg.ahead_s[1] and min(cfg.sigma_m) > 0):
            raise CheckpointError(f"the weights '{source}' predict for impossible times or errors: {cfg}.")
        return cfg


class _NetworkPredictor(Predictor):
    """Window in, two positions out; a parabola through the newest position and those two gives every horizon.

    Past the second the target goes on straight. The deviation grows from that of a measurement to the validation
    errors, then in proportion to time.
    """

    heads: HeadsCfg

    def __init__(self, sigma_m: float, gate: GateCfg | None) -> None:
        super().__init__(gate, YawTracker(turns=False))
        self.sigma_m = sigma_m
        self._window = Window(span_s=WINDOW_N * PERIOD_S + 1.0)

    def _begin(self, measured: Array) -> None:
        self._clock = 0.0
        self._window.clear()
        self._window.add(0.0, measured)

    def _take(self, elapsed_s: float, measured: Array) -> None:
        self._clock += elapsed_s
        self._window.add(self._clock, measured)

    def _normalised(self, newest_s: float) -> tuple[Tensor, Array]:
        """The window (5, 3) that ends then, less its oldest position, which comes second."""
        window = self._window.at(even_times(newest_s, WINDOW_N, PERIOD_S))
        return torch.from_numpy(window - window[0]).float(), window[0]

    @abstractmethod
    def _outputs(self) -> tuple[float, Array, Array]:
        """Time of the newest input, the position (3,) then, and the network's two (2, 3)."""

    def _extrapolate(self, ahead_s: Array) -> Extrapolation:
        newest_s, here, outputs = self._outputs()
        ahead = ahead_s + self._clock - newest_s
        (near, far), values = self.heads.ahead_s, outputs - here
        # p(h) = here + b h + c h², through both outputs.
        c = (values[1] / far - values[0] / near) / (far - near)
        b = values[0] / near - c * near
        within = np.minimum(ahead, far)[:, None]
        velocity = b + 2 * c * within
        position = here + b * within + c * within**2 + velocity * np.maximum(ahead - far, 0.0)[:, None]
        sigma = np.interp(ahead, [0.0, near, far], [self.sigma_m, *self.heads.sigma_m])
        sigma = sigma * np.maximum(ahead / far, 1.0)
        return Extrapolation(position, np.square(sigma)[:, None, None] * np.eye(3), velocity)


class MLPPredictor(_NetworkPredictor):
    """The thesis' multi-layer perceptron.

    Args:
        weights: Shipped ones (``mlp_linear``, ``mlp_circular``, ``mlp_sinusoidal``: one for each class of motion, as in
            the thesis) or a file.
        sigma_m: Standard deviation of a measurement.
        gate: What counts as a leap.

    Raises:
        CheckpointError: No such weights, or foreign or damaged ones.
    """

    def __init__(self, weights: str | Path, sigma_m: float = 1e-3, gate: GateCfg | None = None) -> None:
        super().__init__(sigma_m, gate)
        tensors, settings = load_weights(weights, "mlp")
        self.heads, self.network = HeadsCfg.read(settings, weights), MotionMLP().eval()
        fill(self.network, tensors, weights)

    @torch.no_grad()
    def _outputs(self) -> tuple[float, Array, Array]:
        window, oldest = self._normalised(self._clock)
        outputs = self.network(window).double().numpy()
        return self._clock, oldest + window[-1].double().numpy(), oldest + outputs


class LSTMPredictor(_NetworkPredictor):
    """The thesis' LSTM; its memory goes on every 0.2 s of measured time, however the stamps come.

    As in its training, the memory begins with the first window of five measurements; windows before that, which the
    start position fills, leave nothing behind. After five seconds without a measurement it starts anew.

    Arguments and errors as those of :class:`MLPPredictor`.
    """

    def __init__(self, weights: str | Path, sigma_m: float = 1e-3, gate: GateCfg | None = None) -> None:
        super().__init__(sigma_m, gate)
        tensors, settings = load_weights(weights, "lstm")
        self.heads, self.network = HeadsCfg.read(settings, weights), MotionLSTM().eval()
        fill(self.network, tensors, weights)

    def _begin(self, measured: Array) -> None:
        super()._begin(measured)
        self._steps_n, self._memory = 0, None
        self._step()

    def _take(self, elapsed_s: float, measured: Array) -> None:
        if elapsed_s > LONGEST_GAP_S:
            self._begin(measured)
            return
        super()._take(elapsed_s, measured)
        # Stamps that are 0.2 s apart add up to a little less than a step now and then.
        while self._steps_n * PERIOD_S <= self._clock + 1e-6:
            self._step()

    @torch.no_grad()
    def _step(self) -> None:
        window, oldest = self._normalised(self._steps_n * PERIOD_S)
        memory = self._memory if self._steps_n >= WINDOW_N else None
        outputs, self._memory = self.network(window[None, None], memory)
        self._ahead = oldest + outputs[0, 0].double().numpy()
        self._here = oldest + window[-1].double().numpy()
        self._steps_n += 1

    def _outputs(self) -> tuple[float, Array, Array]:
        return (self._steps_n - 1) * PERIOD_S, self._here, self._ahead
