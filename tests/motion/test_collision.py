from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from tests.motion.conftest import at, postures
from tr_grasp.errors import MotionError
from tr_grasp.motion import CollisionModel, Kinematics, Trajectory, box, convex, point_cloud
from tr_grasp.motion.self_collision import arm_shapes, self_collision_matrix

REACHING = np.array([0.0, -1.2, 1.6, -1.97, -1.57, 0.0])
FOLDED = np.array([0.0, -1.57, 3.0, 0.0, 0.0, 0.0])


def test_all_pairs_are_sorted_once(arm: Kinematics) -> None:
    matrix = self_collision_matrix(arm)
    shapes_n = len(arm_shapes(arm).geometryObjects)
    sorted_pairs = matrix.neighbours + matrix.always + matrix.never + matrix.sometimes
    assert len(sorted_pairs) == len(set(sorted_pairs)) == shapes_n * (shapes_n - 1) // 2
    assert matrix.sometimes
    assert self_collision_matrix(arm) is matrix


def test_home_is_free(arm: Kinematics) -> None:
    assert CollisionModel(arm).free(arm.home_q_rad).all()


def test_a_folded_arm_touches_itself(ur5: Kinematics) -> None:
    model = CollisionModel(ur5)
    contact = model.contact(FOLDED)
    assert not model.free(FOLDED)[0]
    assert contact is not None
    assert {contact.first, contact.second} <= {frame.name for frame in ur5.model.frames}
    assert model.clearance(FOLDED).distance_m < 0


def test_many_at_once_are_checked_like_one_by_one(arm: Kinematics) -> None:
    cloud = np.random.default_rng(0).uniform(-0.1, 0.1, (300, 3)) + np.array([0.4, 0.2, 0.3])
    model = CollisionModel(
        arm,
        [
            box("table", (2, 2, 0.02), at(0, 0, -0.03)),
            convex("rock", np.random.default_rng(1).normal(0, 0.06, (20, 3)), at(0.4, -0.2, 0.4)),
            point_cloud("cloud", cloud, 0.03),
            box("mover", (0.1, 0.1, 0.1), np.eye(4), motion=lambda t: np.array([at(0.4, 0.1 * x, 0.2) for x in t])),
        ],
    )
    q, times = postures(arm, 300), np.linspace(-3, 3, 300)
    free = model.free(q, times)
    assert 0.05 < free.mean() < 0.95
    alone = np.array([model.contact(row, t) is None for row, t in zip(q, times, strict=True)])
    near = np.array([abs(model.clearance(row, t).distance_m) < 2e-4 for row, t in zip(q, times, strict=True)])
    assert (free == alone)[~near].all()
    assert near.mean() < 0.02
    assert model.all_free(q[free], times[free])
    assert not model.all_free(q, times)


def test_clearance_to_a_box_is_the_gap_measured_by_hand(ur5: Kinematics) -> None:
    """The nearest body to a wall ahead of the hand is a finger; moving the wall moves the clearance by as much."""
    gaps = []
    for x in (0.9, 0.95):
        model = CollisionModel(ur5, [box("wall", (0.02, 2, 2), at(x, 0, 1.0))])
        results = [model.clearance(REACHING)]
        assert results[0].distance_m > 0
        gaps.append(distance_to_obstacle(model, REACHING))
    assert gaps[1] - gaps[0] == pytest.approx(0.05, abs=1e-6)


def distance_to_obstacle(model: CollisionModel, q: np.ndarray) -> float:
    """The slow way: every pair with an obstacle, by Pinocchio."""
    shapes, results = model._shapes, model._results
    pin.computeDistances(model._model, model._data, shapes, results, q)
    arm_n = len(arm_shapes(model.kinematics).geometryObjects)
    return min(
        result.min_distance
        for pair, result in zip(shapes.collisionPairs, results.distanceResults, strict=True)
        if pair.second >= arm_n
    )


def test_clearance_can_leave_out_the_arm_itself(ur5: Kinematics) -> None:
    model = CollisionModel(ur5, [box("wall", (0.02, 2, 2), at(0.95, 0, 1.0))])
    clearance = model.clearance(REACHING, to="obstacles")
    assert clearance.second == "wall"
    assert clearance.distance_m == pytest.approx(distance_to_obstacle(model, REACHING))
    with pytest.raises(MotionError, match="nothing"):
        CollisionModel(ur5).clearance(REACHING, to="obstacles")


def test_a_margin_grows_boxes_and_bodies(ur5: Kinematics) -> None:
    x, y, z = hand(ur5)
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * 0.05
    for make in (
        lambda margin: box("it", (0.1, 0.1, 0.1), at(x + 0.25, y, z), margin_m=margin),
        lambda margin: convex("it", corners, at(x + 0.25, y, z), margin_m=margin),
    ):
        gap = CollisionModel(ur5, [make(0.0)]).clearance(REACHING, to="obstacles").distance_m
        assert gap > 2e-3
        less, more = (CollisionModel(ur5, [make(margin)]) for margin in (gap / 2, gap + 1e-3))
        assert less.free(REACHING)[0]
        assert not more.free(REACHING)[0]


def hand(arm: Kinematics) -> np.ndarray:
    """A point inside the hand's body."""
    return (arm.link_pose(REACHING, "tool0") @ at(0, 0, 0.06))[:3, 3]


def test_a_link_may_touch_what_it_is_allowed_to(ur5: Kinematics) -> None:
    def model(*links: str) -> CollisionModel:
        return CollisionModel(ur5, [box("object", (0.04, 0.04, 0.04), at(*hand(ur5)), may_touch=links)])

    contact = model().contact(REACHING)
    assert contact is not None
    assert contact.second == "object"
    assert str(contact) == f"{contact.first} touches object"
    allowed = {contact.first}
    for _ in range(3):
        if (contact := model(*allowed).contact(REACHING)) is not None:
            allowed.add(contact.first)
    assert model(*allowed).free(REACHING)[0]
    with pytest.raises(MotionError, match="unknown link"):
        model("no_such_link")


def test_a_moving_obstacle_is_there_only_at_its_time(ur5: Kinematics) -> None:
    x, y, z = hand(ur5)
    passing = box("passing", (0.05,) * 3, np.eye(4), motion=lambda t: np.array([at(x, y + s - 1, z) for s in t]))
    model = CollisionModel(ur5, [passing])
    assert list(model.free(np.tile(REACHING, (3, 1)), [0.0, 1.0, 2.0])) == [True, False, True]
    waiting = Trajectory.resting(REACHING, 2.0)
    found = model.first_contact(waiting)
    assert found is not None
    assert 0.8 < found[0] < 1.0
    assert found[1].second == "passing"
    assert model.first_contact(waiting, from_s=1.5) is None


def test_a_cloud_of_a_box_s_surface_blocks_like_the_box(ur5: Kinematics) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (4000, 3))
    axis = rng.integers(0, 3, 4000)
    points[np.arange(4000), axis] = np.sign(points[np.arange(4000), axis]) * 0.5
    size, place = np.array([0.1, 0.1, 0.5]), np.array([0.45, 0.25, 0.25])
    solid = CollisionModel(ur5, [box("post", size, at(*place))])
    seen = CollisionModel(ur5, [point_cloud("post", points * size + place, 0.02)])
    q = postures(ur5, 1000)
    assert np.mean(solid.free(q) == seen.free(q)) > 0.97


@pytest.mark.parametrize(
    "make",
    [
        lambda: box("b", (1, 1, 0), np.eye(4)),
        lambda: box("b", (1, 1), np.eye(4)),
        lambda: box("b", (1, 1, 1), np.zeros((4, 4))),
        lambda: box("b", (1, 1, 1), np.eye(4), margin_m=-0.1),
        lambda: convex("b", np.zeros((8, 3)), np.eye(4)),
        lambda: convex("b", [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.eye(4)),
        lambda: convex("b", np.full((8, 3), np.nan), np.eye(4)),
        lambda: point_cloud("b", np.zeros((0, 3))),
        lambda: point_cloud("b", np.full((3, 3), np.nan)),
        lambda: point_cloud("b", np.zeros((3, 3)), 0.0),
    ],
)
def test_what_is_no_obstacle_is_refused(make) -> None:
    with pytest.raises(MotionError, match=r"'b'|resolution_m|margin_m"):
        make()


def test_names_are_unique_and_motions_give_poses(ur5: Kinematics) -> None:
    with pytest.raises(MotionError, match="two called 'a'"):
        CollisionModel(ur5, [box("a", (1, 1, 1), np.eye(4))] * 2)
    broken = CollisionModel(ur5, [box("a", (1, 1, 1), np.eye(4), motion=lambda t: np.eye(4)[None])])
    with pytest.raises(MotionError, match="must give 3 poses, got 1"):
        broken.free(postures(ur5, 3), [0.0, 1.0, 2.0])
