from __future__ import annotations

import pickle

import pytest
import torch

from tests.octree.clouds import SPEC, random_frames
from tr_grasp.errors import ConfigError
from tr_grasp.octree import OctreeFrame, OctreeSpec


def test_frames_keep_type_and_dtypes_when_stacked_indexed_and_pickled() -> None:
    frames = random_frames(4)
    for copy in (torch.stack(list(frames)), frames.reshape(2, 2).flatten(), pickle.loads(pickle.dumps(frames))):
        assert isinstance(copy, OctreeFrame)
        assert copy.codes.dtype == torch.int16
        assert copy.features.dtype == torch.float16
        assert torch.equal(copy.codes, frames.codes)


def test_a_frame_of_512_leaves_takes_8_kib() -> None:
    frame = OctreeFrame.unoccupied(SPEC)
    assert frame.codes.nbytes + frame.features.nbytes == 8 * 1024


def test_an_empty_frame_has_no_leaves() -> None:
    frames = OctreeFrame.unoccupied(SPEC, (2, 3))
    assert frames.batch_size == (2, 3)
    assert not frames.leaves_n.any()


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"depth": 7}, "depth"),
        ({"depth": 2}, "depth"),
        ({"side_m": 0.0}, "side_m"),
        ({"side_m": float("nan")}, "side_m"),
        ({"leaf_capacity": 0}, "leaf_capacity"),
        ({"origin_m": (0.0, 0.0)}, "origin_m"),
    ],
)
def test_an_impossible_cube_is_refused_by_name(change: dict, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        OctreeSpec(**({"origin_m": (0.0, 0.0, 0.0), "side_m": 1.0} | change))


def test_sizes_of_the_standard_cube() -> None:
    assert SPEC.leaf_m == pytest.approx(0.015)
    assert SPEC.centre_m == pytest.approx((0.5, 0.0, 0.1125))
