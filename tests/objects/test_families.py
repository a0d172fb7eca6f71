from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tr_grasp.objects import FAMILIES, ObjectModel, family_names
from tr_grasp.objects.families import WIDE
from tr_grasp.objects.family import OUTER_SHARE, SPLITS, family
from tr_grasp.objects.model import MAX_PART_VERTICES, distance_outside

ALL = FAMILIES | WIDE
NAMES = sorted(ALL)
SAMPLES_N = 200
GRIPPER_OPENING_M = 0.08


def is_same(first: ObjectModel, second: ObjectModel) -> bool:
    return (
        first.name == second.name
        and np.array_equal(first.visual.vertices, second.visual.vertices)
        and np.array_equal(first.face_colours, second.face_colours)
    )


@pytest.fixture(scope="module", params=[(name, split) for name in NAMES for split in SPLITS], ids="-".join)
def samples(request) -> list[ObjectModel]:
    name, split = request.param
    rng = np.random.default_rng(0)
    return [ALL[name].sample(split, rng) for _ in range(SAMPLES_N)]


def test_every_size_fits_the_workspace_and_the_gripper(samples):
    diagonals = np.array([model.diagonal_m for model in samples])
    extents = np.sort([model.extents_m for model in samples], axis=1)
    assert diagonals.min() > 0.055
    assert diagonals.max() < 0.18
    # A gripper reaches around two of the three extents, or around a thin wall or a bar.
    slender = samples[0].family in {"bowl", "plate", "ring", "tee", "cross", "bracket", "mug", "hammer", *WIDE}
    assert (extents[:, 0] < 0.065).all()
    assert slender or (extents[:, 1] < GRIPPER_OPENING_M - 0.01).all()


def test_parts_are_closed_convex_outward_and_small(samples):
    for part in (part for model in samples[:5] for part in model.parts):
        assert np.isfinite(part.vertices).all()
        assert part.is_watertight
        assert part.is_winding_consistent
        assert part.volume > 0
        assert len(part.vertices) <= MAX_PART_VERTICES
        assert part.volume == pytest.approx(part.convex_hull.volume, rel=1e-6)


def test_the_origin_is_the_centre_of_mass_and_parts_do_not_overlap(samples):
    model = samples[0]
    points = np.random.default_rng(1).uniform(*model.bounds_m, (40_000, 3))
    covered = sum((distance_outside(part, points) < 0).astype(int) for part in model.parts)
    assert covered.max() == 1
    # Against a Monte Carlo estimate of volume and centre; the former from trimesh to full precision.
    box_volume = np.prod(model.extents_m)
    assert model.volume_m3 == pytest.approx(box_volume * (covered > 0).mean(), rel=0.1)
    volumes = [part.volume for part in model.parts]
    centre = np.average([part.center_mass for part in model.parts], axis=0, weights=volumes)
    np.testing.assert_allclose(centre, 0, atol=1e-6)
    np.testing.assert_allclose(points[covered > 0].mean(axis=0), 0, atol=0.003)


def test_the_visual_is_the_parts_with_one_colour_a_face(samples):
    for model in samples[:5]:
        assert model.face_colours.shape == (len(model.visual.faces), 3)
        assert model.face_colours.dtype == np.float32
        assert 0 <= model.face_colours.min() <= model.face_colours.max() <= 1
        assert len(model.visual.faces) <= 300
        np.testing.assert_allclose(model.visual.bounds, model.bounds_m)
        assert model.visual.volume == pytest.approx(model.volume_m3)


def test_the_same_seed_gives_the_same_object_and_another_seed_another(samples):
    kind = ALL[samples[0].family]
    first, again, other = (kind.sample("train", np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert is_same(first, again)
    assert first.name != other.name


@pytest.mark.parametrize("name", NAMES)
def test_training_draws_from_the_middle_of_every_range_and_testing_from_its_ends(name):
    rng = np.random.default_rng(2)
    kind = ALL[name]
    for key, (low, high) in kind.ranges.items():
        shares = {
            split: [(kind.draw(split, rng)[key] - low) / (high - low) for _ in range(SAMPLES_N)] for split in SPLITS
        }
        train, test = np.array(shares["train"]), np.array(shares["test"])
        assert OUTER_SHARE <= train.min() < 0.25
        assert 0.75 < train.max() <= 1 - OUTER_SHARE
        assert ((test >= 0) & (test <= OUTER_SHARE) | (test >= 1 - OUTER_SHARE) & (test <= 1)).all()
        assert 0.3 < (test < 0.5).mean() < 0.7


def test_some_families_are_kept_for_testing():
    held_out = set(family_names("test")) - set(family_names("train"))
    assert {"cup", "can", "tool", "bracket"} <= held_out
    assert set(family_names("train")) < set(family_names("test")) == set(FAMILIES)
    assert len(family_names("train")) >= 14


def test_a_mug_of_given_size_has_the_extents_worked_by_hand():
    dimensions = {
        "radius_m": 0.03,
        "height_m": 0.08,
        "wall_m": 0.004,
        "handle_reach_m": 0.02,
        "handle_height_m": 0.04,
        "handle_thickness_m": 0.008,
    }
    model = FAMILIES["mug"].model(dimensions, np.random.default_rng(0))
    flat = 0.03 * np.cos(np.pi / 12)
    assert model.extents_m == pytest.approx([2 * flat + 0.02, 2 * flat, 0.08])
    # The handle pulls the centre of mass towards it, so the far side is farther away than the radius.
    assert -model.bounds_m[0, 0] > 0.03


def test_a_cross_of_given_size_has_the_volume_of_two_bars_less_their_crossing():
    dimensions = {"long_m": 0.1, "short_m": 0.08, "width_m": 0.02, "thickness_m": 0.02, "angle_rad": np.pi / 2}
    model = FAMILIES["cross"].model(dimensions, np.random.default_rng(0))
    assert model.volume_m3 == pytest.approx((0.1 + 0.08 - 0.02) * 0.02 * 0.02)
    assert model.extents_m == pytest.approx([0.1, 0.08, 0.02])


def test_groups_are_coloured_apart_in_about_half_of_the_objects():
    rng = np.random.default_rng(3)
    colours_n = [len(np.unique(FAMILIES["hammer"].sample("train", rng).face_colours, axis=0)) for _ in range(100)]
    assert set(colours_n) == {1, 2}
    assert 30 < colours_n.count(1) < 70


def test_a_family_whose_ranges_do_not_fit_its_builder_is_refused():
    def brick(edge_m: float) -> list[list[trimesh.Trimesh]]:
        return []

    with pytest.raises(TypeError, match="must be those of its arguments"):
        family(side_m=(0.1, 0.2))(brick)
    with pytest.raises(TypeError, match="must be low < high"):
        family(edge_m=(0.2, 0.1))(brick)
