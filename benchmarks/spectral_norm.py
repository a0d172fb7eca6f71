"""What spectral normalisation does to critics: ``python -m benchmarks.spectral_norm``.

Prints JSON rows. Two dense-residual critics learn quantiles of returns up to 400, as the task pays them, from one fixed
set of features and actions by the quantile Huber loss: once as they are, once with returns a hundredth as large, once
with a learned factor on their output, each with and without spectral normalisation of the residual blocks (as the
setting ``critic`` does it) and of every layer (which it never does). After the updates: the loss of the mean return in
units of its variance, the norm of the gradient in the action (returns per unit of action), the gradient of the
parameters, and a bound of the blocks' slope, the product of ``1 + sigma(A) sigma(B)``. Then an actor climbs the
critics, and the last two numbers say what they promise it and what is true.
"""

from __future__ import annotations

import argparse
import json
from functools import partial

import torch
from torch import Tensor, nn

from benchmarks._common import machine
from tr_grasp.modules import DenseResidualMLP, QuantileCritic
from tr_grasp.modules.heads import OutputScale, normalise_kernels

FEATURES_N, ACTION_N, QUANTILES_N, SAMPLES_N = 32, 5, 25, 2048
LARGEST_RETURN = 400.0


def true_return(features: Tensor, action: Tensor) -> Tensor:
    """``(*batch,)``: 400 where the action is near what the features ask for, then falling fast."""
    wanted = torch.tanh(features[..., :ACTION_N])
    return LARGEST_RETURN * torch.exp(-4 * (action - wanted).square().mean(-1))


def make_critic(norm: str, scale: nn.Module | None, width: int, blocks_n: int) -> QuantileCritic:
    """A critic with spectral normalisation of no layer, of the residual blocks, or of every layer."""
    make_net = partial(DenseResidualMLP, width=width, blocks_n=blocks_n, spectral_norm=norm == "blocks")
    critic = QuantileCritic(FEATURES_N, ACTION_N, QUANTILES_N, make_net=make_net, scale=scale)
    if norm == "every layer":
        normalise_kernels(critic)
    return critic


def quantile_loss(quantiles: Tensor, target: Tensor) -> Tensor:
    """Huber quantile regression of one sample of the return for each state and action."""
    u = target[:, None] - quantiles
    huber = torch.where(u.abs() <= 1, 0.5 * u**2, u.abs() - 0.5)
    levels = (torch.arange(QUANTILES_N) + 0.5) / QUANTILES_N
    return ((levels - (u.detach() < 0).float()).abs() * huber).mean()


def slope_bound(critic: nn.Module) -> float:
    """Product over the blocks of ``1 + sigma(A) sigma(B)``, singular values by 50 power iterations."""
    bound = 1.0
    for block in critic.net.blocks:
        sigmas = [largest_singular_value(layer.weight.detach()) for layer in (block.a, block.b)]
        bound *= 1 + sigmas[0] * sigmas[1]
    return bound


def largest_singular_value(matrix: Tensor, iterations_n: int = 50) -> float:
    """By power iteration."""
    v = torch.ones(matrix.shape[1])
    for _ in range(iterations_n):
        v = nn.functional.normalize(matrix.T @ (matrix @ v), dim=0)
    return float((matrix @ v).norm())


def deceived_actor(critic: nn.Module, features: Tensor, reward_scale: float) -> tuple[float, float]:
    """Climb the critic from random actions: the return that it promises, and the true one."""
    raw = torch.zeros(len(features), ACTION_N).normal_(0, 0.5).requires_grad_()
    optimiser = torch.optim.Adam([raw], lr=0.05)
    critic.requires_grad_(False)
    for _ in range(100):
        optimiser.zero_grad()
        (-critic(features, torch.tanh(raw)).mean()).backward()
        optimiser.step()
    action = torch.tanh(raw.detach())
    promised = float(critic(features, action).mean()) / reward_scale
    return promised, float(true_return(features, action).mean())


def run(norm: str, output: str, args: argparse.Namespace) -> dict[str, object]:
    """Train one critic and look at it."""
    torch.manual_seed(args.seed)
    reward_scale = 0.01 if output == "returns / 100" else 1.0
    critic = make_critic(
        norm, OutputScale(1.0, learned=True) if output == "learned scale" else None, args.width, args.blocks
    )
    features, action = torch.randn(SAMPLES_N, FEATURES_N), torch.rand(SAMPLES_N, ACTION_N) * 2 - 1
    target = reward_scale * true_return(features, action)
    optimiser = torch.optim.Adam(critic.parameters(), lr=args.learning_rate)
    for _ in range(args.updates):
        rows = torch.randint(SAMPLES_N, (args.batch,))
        optimiser.zero_grad()
        quantile_loss(critic(features[rows], action[rows]), target[rows]).backward()
        gradient = nn.utils.clip_grad_norm_(critic.parameters(), float("inf"))
        optimiser.step()
    critic.eval()
    seen = action.clone().requires_grad_()
    value = critic(features, seen).mean(-1)
    (slope,) = torch.autograd.grad(value.sum(), seen)
    promised, true = deceived_actor(critic, features[:256], reward_scale)
    return {
        "spectral_norm": norm,
        "output": output,
        "unexplained_variance": round(float((value.detach() - target).square().mean() / target.var()), 4),
        "largest_value": round(float(value.detach().max()) / reward_scale, 1),
        "action_slope": round(float(slope.norm(dim=1).mean()) / reward_scale, 1),
        "parameter_gradient": round(float(gradient), 4),
        "slope_bound_of_blocks": round(slope_bound(critic), 2),
        "promised_return": round(promised, 1),
        "true_return": round(true, 1),
    }


def main() -> None:
    """Read the flags and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--updates", type=int, default=1500)
    parser.add_argument("--batch", type=int, default=64)
    parser.add_argument("--width", type=int, default=64)
    parser.add_argument("--blocks", type=int, default=2)
    parser.add_argument("--learning-rate", type=float, default=7e-4)
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    torch.set_num_threads(1)
    for output in ("returns", "returns / 100", "learned scale"):
        for norm in ("none", "blocks", "every layer"):
            row = {"name": "critic after training", **run(norm, output, args)}
            print(json.dumps(row | {**vars(args), "machine": machine()}), flush=True)


if __name__ == "__main__":
    main()
