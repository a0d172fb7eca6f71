import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.geometry import wrap_half_turn
from tr_grasp.grasps import GripperShape, HeightMap, height_map_of_points, top_down_grasps
from tr_grasp.grasps.top_down import Demands, _max_over_offsets

CELL = 0.004
N = 81
AXIS = (np.arange(N) - (N - 1) / 2) * CELL
CORNERS = Demands(flatness=0.05, corner_width_m=0.036)


def scene(*blocks: tuple[float, float, float, float, float, float], cell: float = CELL) -> tuple[HeightMap, np.ndarray]:
    """A height map of blocks (x, y, length, width, height, yaw) and their centres."""
    axis = np.arange(AXIS[0], -AXIS[0] + cell / 2, cell)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    height, owner = np.zeros(x.shape), np.full(x.shape, -1)
    for index, (cx, cy, length, width, top, yaw) in enumerate(blocks):
        u = (x - cx) * np.cos(yaw) + (y - cy) * np.sin(yaw)
        w = -(x - cx) * np.sin(yaw) + (y - cy) * np.cos(yaw)
        inside = (np.abs(u) <= length / 2) & (np.abs(w) <= width / 2)
        height = np.where(inside & (top > height), top, height)
        owner = np.where(inside & (top >= height), index, owner)
    return HeightMap(height, owner, (AXIS[0], AXIS[0]), cell), np.array([block[:2] for block in blocks])


@settings(max_examples=20)
@given(x=st.floats(-0.06, 0.06), y=st.floats(-0.06, 0.06), yaw=st.floats(0, 3.1))
def test_a_long_block_is_taken_across_near_its_middle_wherever_it_lies(x, y, yaw):
    grasps = top_down_grasps(*scene((x, y, 0.13, 0.04, 0.05, yaw)))
    assert len(grasps)
    assert np.linalg.norm(grasps.position[0, :2] - [x, y]) < 0.02
    assert abs(wrap_half_turn(grasps.yaw_rad[0] - (yaw + np.pi / 2))) < 0.35  # 11 degree steps, 4 mm cells
    assert abs(grasps.width_m[0] - 0.04) <= 0.013


def test_the_depth_is_set_by_the_palm_for_a_tall_block_and_by_the_table_for_a_flat_one():
    gripper = GripperShape()
    tall = top_down_grasps(*scene((0, 0, 0.04, 0.04, 0.12, 0)))
    flat = top_down_grasps(*scene((0, 0, 0.06, 0.04, 0.02, 0)), lowest_tcp_m=0.012)
    np.testing.assert_allclose(tall.position[0, 2], 0.12 - gripper.palm_above_tcp_m + gripper.clearance_m, atol=1e-9)
    # fingertips 9.5 mm under the tcp keep 3 mm over the table
    np.testing.assert_allclose(flat.position[0, 2], 0.0125, atol=1e-9)


def test_a_block_wider_than_the_opening_cannot_be_taken():
    assert len(top_down_grasps(*scene((0, 0, 0.12, 0.12, 0.05, 0)))) == 0


def test_a_block_wider_than_the_opening_is_taken_by_its_corners_if_they_will_do():
    block = scene((0, 0, 0.12, 0.12, 0.05, 0), cell=0.002)
    found = top_down_grasps(*block, demands=CORNERS)
    assert len(found)
    # Pads over a diagonal, so that both flanks slant by 45 degrees: its end is 85 mm from the middle, and what is
    # held between pads 18 mm wide is twice as wide as the corner is deep there.
    slant = np.abs(wrap_half_turn(2 * (found.yaw_rad - np.pi / 4))) / 2
    assert slant.max() < 0.25
    corner_m = 0.06 * np.sqrt(2) - np.linalg.norm(found.position[:, :2], axis=1)
    np.testing.assert_allclose(found.width_m, 2 * (corner_m + 0.009), atol=0.01)
    assert found.width_m.min() >= CORNERS.corner_width_m
    assert len(top_down_grasps(*block)) == 0


def test_a_tight_fit_is_taken_if_less_room_beside_it_will_do():
    block = scene((0, 0.001, 0.12, 0.075, 0.05, 0), cell=0.002)
    tight = top_down_grasps(*block, demands=Demands(spare_m=0.003))
    assert len(tight)
    np.testing.assert_allclose(tight.width_m, 0.075, atol=0.002)
    assert len(top_down_grasps(*block)) == 0


def test_a_dish_wider_than_the_opening_is_taken_by_its_rim():
    x, y = np.meshgrid(AXIS, AXIS, indexing="ij")
    radius = np.hypot(x, y)
    height = np.where(radius < 0.058, np.where(radius > 0.052, 0.02, 0.004), 0.0)
    dish = HeightMap(height, np.where(radius < 0.058, 0, -1), (AXIS[0], AXIS[0]), CELL)
    found = top_down_grasps(dish, np.zeros((1, 2)))
    assert len(found)
    np.testing.assert_allclose(np.linalg.norm(found.position[:, :2], axis=1), 0.055, atol=0.008)
    # The finger inside stays 3 mm over the bottom, 16 mm under the rim.
    np.testing.assert_allclose(found.depth_m, 0.013, atol=1e-9)


def test_an_empty_table_offers_nothing():
    assert (
        len(
            top_down_grasps(
                HeightMap(np.zeros((N, N)), np.full((N, N), -1), (AXIS[0], AXIS[0]), CELL), np.zeros((0, 2))
            )
        )
        == 0
    )


def test_a_wall_beside_a_block_turns_the_grasp_or_lifts_it():
    walled = top_down_grasps(*scene((0, 0, 0.05, 0.04, 0.05, 0), (0, 0.035, 0.16, 0.02, 0.05, 0)))
    of_block = walled.owner == 0
    across = np.abs(wrap_half_turn(walled.yaw_rad - np.pi / 2)) < 0.2
    deep = walled.position[:, 2] < 0.04
    assert of_block.any()
    assert not (of_block & across & deep & (np.abs(walled.width_m - 0.04) < 0.01)).any()


def test_no_grasp_lies_outside_the_tools_reach():
    blocks = scene((-0.06, 0, 0.04, 0.04, 0.05, 0), (0.06, 0, 0.04, 0.04, 0.05, 0))
    grasps = top_down_grasps(*blocks, within_m=((-0.1, -0.1), (0.0, 0.1)))
    np.testing.assert_array_equal(np.unique(grasps.owner), [0])
    assert (grasps.position[:, 0] <= 0).all()


def test_the_depth_is_from_the_top_to_the_fingertips():
    flat = top_down_grasps(*scene((0, 0, 0.06, 0.04, 0.02, 0)))
    np.testing.assert_allclose(flat.depth_m[0], 0.02 - (flat.position[0, 2] - GripperShape().tip_below_tcp_m))


def test_grasps_come_best_first_and_name_their_object():
    grasps = top_down_grasps(*scene((-0.06, 0, 0.04, 0.04, 0.05, 0), (0.06, 0, 0.04, 0.04, 0.05, 0)))
    assert (np.diff(grasps.score) <= 0).all()
    np.testing.assert_array_equal(np.sign(grasps.position[:, 0]), np.where(grasps.owner == 1, 1, -1))


@given(seed=st.integers(0, 1000), first=st.integers(1, 4), extra=st.integers(0, 3))
def test_the_finger_footprint_is_the_slow_maximum(seed, first, extra):
    values = np.random.default_rng(seed).uniform(0, 1, (15, 3))
    last = first + extra
    slow = np.zeros_like(values)
    for i in range(15):
        for distance in range(first, last + 1):
            for k in (i - distance, i + distance):
                if 0 <= k < 15:
                    slow[i] = np.maximum(slow[i], values[k])
    np.testing.assert_array_equal(_max_over_offsets(values, first, last), slow)


def test_a_map_of_points_is_what_the_points_show_with_gaps_between_them_closed():
    """A plate of 40 x 20 mm, 30 mm over a table at 0.1 m, in points 3 mm apart; one pixel was lost."""
    x, y = np.meshgrid(np.linspace(-0.02, 0.02, 15), np.linspace(-0.01, 0.01, 8), indexing="ij")
    points = np.stack([x.ravel() + 0.5, y.ravel(), np.full(x.size, 0.13)], axis=1)
    points = np.delete(points, len(points) // 2, axis=0)
    seen = height_map_of_points(points, (0.5, 0.0), 0.1, CELL, table_m=0.1)
    high = seen.height > 0
    assert seen.height[high] == pytest.approx(0.03)
    assert high.sum() * CELL**2 == pytest.approx(0.04 * 0.02, rel=0.5)  # cells at the edges belong to it whole
    assert (seen.owner[high] == 0).all()
    assert (seen.owner[~high] == -1).all()
    i, j = np.nonzero(high)
    middle = np.array(seen.origin_m) + CELL * np.array([i.mean(), j.mean()])
    assert middle == pytest.approx([0.5, 0.0], abs=0.6 * CELL)
