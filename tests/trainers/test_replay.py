from __future__ import annotations

import mmap
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from tensordict import TensorDict

from tr_grasp.errors import CheckpointError
from tr_grasp.octree import OctreeFrame
from tr_grasp.trainers import ReplayBuffer
from tr_grasp.trainers.replay import OBSERVATIONS_FOR_ANY_LENGTH

LEAVES_N = 4


@dataclass
class Worker:
    """An environment whose observations are numbers, all different; stacks begin with the first one repeated."""

    stack_n: int
    numbers: count = field(default_factory=count)
    stack: list[int] = field(default_factory=list)

    def chunk(self, ends: list[bool]) -> TensorDict:
        """One step for each entry; True ends the episode. The next chunk goes on where this one stopped."""
        return torch.stack([self._step(end) for end in ends])

    def _step(self, end: bool) -> TensorDict:
        self.stack = self.stack or [next(self.numbers)] * self.stack_n
        before = observation(self.stack)
        self.stack = [*self.stack[1:], next(self.numbers)]
        after = observation(self.stack)
        number = float(self.stack[-1])
        flags = {"terminated": end and number % 2 == 0, "truncated": end and number % 2 == 1, "done": end}
        after.update({name: torch.tensor([flag]) for name, flag in flags.items()})
        after["reward"] = torch.tensor([-number])
        self.stack = [] if end else self.stack
        return before.update({"action": torch.full((5,), number), "next": after})


def observation(numbers: list[int]) -> TensorDict:
    values = torch.tensor(numbers)
    stack_n = len(numbers)
    octree = OctreeFrame(
        codes=values[:, None].expand(stack_n, LEAVES_N).to(torch.int16),
        features=values[:, None, None].expand(stack_n, LEAVES_N, 7).half() / 1024,
        batch_size=[stack_n],
    )
    newest = float(numbers[-1])
    return TensorDict(
        {
            "octree": octree,
            "proprio": values[:, None].expand(stack_n, 10).float(),
            "stages": torch.full((4,), newest),
            "expert_action": torch.full((5,), newest + 0.5),
        },
        batch_size=[],
    )


def assert_same(got: TensorDict, expected: TensorDict) -> None:
    """Bit for bit, in the same dtypes."""
    for part_got, part_expected in ((got, expected), (got["next"], expected["next"])):
        for name in ("proprio", "stages", "expert_action"):
            assert torch.equal(part_got[name], part_expected[name]), name
        assert torch.equal(part_got["octree"].codes, part_expected["octree"].codes)
        assert torch.equal(part_got["octree"].features, part_expected["octree"].features)
    assert torch.equal(got["action"], expected["action"])
    for name in ("reward", "terminated", "truncated", "done"):
        assert torch.equal(got["next", name], expected["next", name]), name


chunks_of_ends = st.lists(
    st.tuples(st.integers(0, 2), st.lists(st.booleans(), min_size=1, max_size=9)), min_size=1, max_size=14
)


@settings(max_examples=40)
@given(chunks_of_ends, st.integers(1, 3), st.integers(12, 40))
def test_what_comes_out_is_what_the_environments_gave(chunks, stack_n, capacity):
    """Against a plain list, over several turns of the ring, with chunks of three workers in any order."""
    numbers = count()
    workers = [Worker(stack_n, numbers) for _ in range(3)]
    buffer, reference = ReplayBuffer(capacity, stack_n), []
    for worker, ends in chunks:
        chunk = workers[worker].chunk(ends)
        buffer.extend(chunk)
        reference += list(chunk)
        kept = torch.arange(buffer.written - len(buffer), buffer.written)
        assert buffer.written == len(reference)
        assert 0 < len(buffer) <= capacity
        assert_same(buffer.get(kept), torch.stack([reference[int(n)] for n in kept]))


@settings(max_examples=30)
@given(st.lists(st.booleans(), min_size=10, max_size=40))
def test_no_transition_gives_way_early_when_there_is_room_for_any_length(ends):
    worker, buffer = Worker(2), ReplayBuffer(20, 2, OBSERVATIONS_FOR_ANY_LENGTH)
    for start in range(0, len(ends), 10):
        buffer.extend(worker.chunk(ends[start : start + 10]))
    assert len(buffer) == min(20, len(ends))


def test_a_ring_that_wraps_in_mid_episode_gives_up_what_it_overwrites():
    worker, buffer = Worker(3), ReplayBuffer(16, 3)
    # Observations fit 16 * 1.125 + 12 = 30; four chunks of ten without an end store 3 + 10 each.
    for _ in range(4):
        buffer.extend(worker.chunk([False] * 10))
    assert len(buffer) == 16
    # Episodes of one step need two observations a step: now observations are what is short.
    for _ in range(4):
        buffer.extend(worker.chunk([True] * 10))
    assert len(buffer) < 16
    oldest = buffer.get(torch.tensor([buffer.written - len(buffer)]))
    assert torch.equal(oldest["action"][0, 0], oldest["next", "proprio"][0, -1, 0])


def test_the_last_observation_of_an_episode_is_kept():
    worker, buffer = Worker(2), ReplayBuffer(100, 2)
    chunk = worker.chunk([False, True, False])
    buffer.extend(chunk)
    assert_same(buffer.get(torch.arange(3)), chunk)
    assert buffer.get(torch.tensor([1]))["next", "proprio"][0, :, 0].tolist() == [1.0, 2.0]
    assert buffer.get(torch.tensor([2]))["proprio"][0, :, 0].tolist() == [3.0, 3.0]


def test_what_is_observed_alone_is_stored_and_depth_takes_two_bytes_a_pixel():
    worker, buffer = Worker(2), ReplayBuffer(100, 2, observed=("colour_image", "depth_image", "proprio"))
    chunk = worker.chunk([False, True, False])
    for part in (chunk, chunk["next"]):
        numbers = part["proprio"][..., :1, None, None]
        part["colour_image"] = numbers.expand(3, 2, 3, 4, 4).to(torch.uint8)
        part["depth_image"] = 0.5 + numbers[..., 0, :, :, None].expand(3, 2, 1, 4, 4) * 1e-4
    buffer.extend(chunk)
    got = buffer.get(torch.arange(3))
    assert "octree" not in got
    for part, expected in ((got, chunk), (got["next"], chunk["next"])):
        assert torch.equal(part["colour_image"], expected["colour_image"])
        assert part["depth_image"].dtype == torch.float16
        torch.testing.assert_close(part["depth_image"].float(), expected["depth_image"], rtol=0, atol=2.5e-4)
    # 5 bytes a pixel, 16 pixels, room for 120 observations; the rest is proprioception, labels and outcomes.
    pictures = buffer.state_dict()["observations"]
    assert pictures["colour_image"].nbytes + pictures["depth_image"].nbytes == len(pictures["proprio"]) * 5 * 16


def test_every_observation_of_a_chunk_is_stored_once():
    worker, buffer = Worker(3), ReplayBuffer(100, 3)
    buffer.extend(worker.chunk([False] * 9 + [True] + [False] * 10))
    # 20 steps in two episodes show 22 observations; the first stack brings its two older ones along.
    assert buffer.state_dict()["counters"][0] == 22 + 2


def test_samples_are_uniform_over_what_is_stored():
    worker, buffer = Worker(1), ReplayBuffer(20, 1)
    for _ in range(5):
        buffer.extend(worker.chunk([False] * 10))
    drawn = buffer.sample(20_000, torch.Generator().manual_seed(0))["action"][:, 0].long()
    counts = torch.bincount(drawn - drawn.min(), minlength=20).float()
    assert len(counts) == 20
    # Each count is about 1000 with a deviation of 31.
    assert (counts - 1000).abs().max() < 150


def test_the_same_generator_draws_the_same_batch():
    worker, buffer = Worker(1), ReplayBuffer(20, 1)
    buffer.extend(worker.chunk([False] * 10))
    first, second = (buffer.sample(6, torch.Generator().manual_seed(7)) for _ in range(2))
    assert_same(first, second)


def test_the_types_of_the_octree_survive():
    worker, buffer = Worker(2), ReplayBuffer(20, 2)
    buffer.extend(worker.chunk([False] * 5))
    frames = buffer.sample(3)["octree"]
    assert isinstance(frames, OctreeFrame)
    assert frames.batch_size == (3, 2)
    assert (frames.codes.dtype, frames.features.dtype) == (torch.int16, torch.float16)


@pytest.mark.parametrize("steps_n", [7, 60], ids=["part filled", "wrapped"])
def test_a_restored_buffer_goes_on_exactly(steps_n, tmp_path):
    worker, buffer = Worker(2), ReplayBuffer(30, 2)
    for _ in range(steps_n // 7 + 1):
        buffer.extend(worker.chunk([False] * 6 + [True]))
    torch.save(buffer.state_dict(), tmp_path / "replay.pt")
    restored = ReplayBuffer(30, 2)
    restored.load_state_dict(torch.load(tmp_path / "replay.pt", weights_only=True))
    more = worker.chunk([False] * 20)
    for each in (buffer, restored):
        each.extend(more)
    draws = [each.sample(50, torch.Generator().manual_seed(1)) for each in (buffer, restored)]
    assert_same(*draws)
    assert len(buffer) == len(restored)


def test_only_the_filled_part_is_saved(tmp_path):
    worker, buffer = Worker(2), ReplayBuffer(100_000, 2)
    buffer.extend(worker.chunk([False] * 6))
    torch.save(buffer.state_dict(), tmp_path / "replay.pt")
    assert (tmp_path / "replay.pt").stat().st_size < 20_000


def wide_step() -> TensorDict:
    octree = OctreeFrame(
        codes=torch.zeros(3, 512, dtype=torch.int16), features=torch.zeros(3, 512, 7).half(), batch_size=[3]
    )
    step = TensorDict({"octree": octree, "proprio": torch.zeros(3, 10), "stages": torch.zeros(4)})
    step["next"] = step.clone()
    step["next"].update({name: torch.tensor([False]) for name in ("done", "terminated", "truncated")})
    step["next", "reward"], step["action"] = torch.zeros(1), torch.zeros(5)
    return step


def test_a_hundred_thousand_octrees_of_512_leaves_fit_in_a_gigabyte():
    buffer = ReplayBuffer(1000, 3)
    buffer.extend(wide_step()[None])
    assert 8192 < buffer.bytes_per_transition < 10_000


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux' count of memory pages")
def test_memory_is_taken_as_the_buffer_fills():
    def resident_bytes() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * mmap.PAGESIZE

    before = resident_bytes()
    buffer = ReplayBuffer(20_000, 3)
    buffer.extend(wide_step()[None])
    assert buffer.bytes_per_transition * buffer.capacity > 180e6
    assert resident_bytes() - before < 20e6


def test_an_empty_buffer_cannot_be_sampled():
    with pytest.raises(ValueError, match="empty"):
        ReplayBuffer(10, 1).sample(1)


def test_chunks_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="stacks must have 2"):
        ReplayBuffer(10, 2).extend(Worker(3).chunk([False]))
    with pytest.raises(ValueError, match="does not fit"):
        ReplayBuffer(10, 2).extend(Worker(2).chunk([False] * 11))


def test_a_state_of_another_size_is_refused():
    with pytest.raises(CheckpointError, match="capacity 10 and stacks of 1"):
        ReplayBuffer(20, 1).load_state_dict(ReplayBuffer(10, 1).state_dict())
