"""Memory and speed of the replay buffer: ``python -m benchmarks.replay``.

Prints JSON rows for a full buffer: bytes that it takes, milliseconds to draw a batch and to store a chunk. Peer of the
memory: each transition with both of its stacks, as a plain replay buffer keeps them.
"""

from __future__ import annotations

import argparse

import torch
from tensordict import TensorDict

from benchmarks._common import median_ms, print_row, tabletop_frames
from tr_grasp.trainers import ReplayBuffer


def chunk(steps_n: int, stack_n: int, episode_steps: int) -> TensorDict:
    """Steps of episodes of equal length, as a collector hands them over."""
    frames = tabletop_frames(32)
    steps = TensorDict(
        {
            "octree": frames[torch.randint(32, (steps_n, stack_n))],
            "proprio": torch.randn(steps_n, stack_n, 10),
            "stages": torch.zeros(steps_n, 4),
        },
        batch_size=[steps_n],
    )
    following = steps.clone()
    done = (torch.arange(steps_n)[:, None] + 1) % episode_steps == 0
    following.update({"done": done, "terminated": done, "truncated": torch.zeros_like(done)})
    following["reward"] = torch.zeros(steps_n, 1)
    return steps.update({"action": torch.zeros(steps_n, 5), "next": following})


def main() -> None:
    """Read the flags and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--capacity", type=int, default=100_000)
    parser.add_argument("--stack", type=int, default=3)
    parser.add_argument("--episode-steps", type=int, default=20)
    parser.add_argument("--batch", type=int, default=64)
    args = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(0)
    buffer = ReplayBuffer(args.capacity, args.stack)
    steps = chunk(100, args.stack, args.episode_steps)
    while buffer.written < args.capacity:
        buffer.extend(steps)
    sample_ms, store_ms = median_ms(lambda: buffer.sample(args.batch), lambda: buffer.extend(steps), repeats=50)
    gigabytes = buffer.bytes_per_transition * args.capacity / 1e9
    plain_gigabytes = sum(leaf.nbytes for leaf in steps.values(True, True)) / len(steps) * args.capacity / 1e9
    memory = {"gigabytes": round(gigabytes, 3), "peer_gigabytes": round(plain_gigabytes, 3), "kept": len(buffer)}
    size = {"capacity": args.capacity, "stack": args.stack}
    print_row("replay, draw a batch", sample_ms, batch=args.batch, **size, **memory)
    print_row("replay, store a chunk", store_ms, steps=len(steps), **size)


if __name__ == "__main__":
    main()
