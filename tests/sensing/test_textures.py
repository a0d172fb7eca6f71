from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.errors import ConfigError
from tr_grasp.sensing.textures import CELLS, FAMILIES, draw_recipe, hue_sector, texture_image

EVERY = [(split, family) for split, families in FAMILIES.items() for family in families]


def test_there_are_enough_families_and_no_split_has_one_of_the_other():
    assert len(FAMILIES["train"]) >= 6
    assert len(FAMILIES["test"]) >= 4
    assert not set(FAMILIES["train"]) & set(FAMILIES["test"])
    assert not set(FAMILIES["train"].values()) & set(FAMILIES["test"].values())


@settings(max_examples=50)
@given(seed=st.integers(0, 2**31))
def test_splits_share_no_number_of_cells_and_no_hue(seed):
    for parity, split in enumerate(("train", "test")):
        recipe = draw_recipe(split, np.random.default_rng(seed))
        assert recipe.family in FAMILIES[split]
        assert recipe.cells in CELLS[split]
        assert {hue_sector(colour) % 2 for colour in recipe.palette} == {parity}
    assert not set(CELLS["train"]) & set(CELLS["test"])


@pytest.mark.parametrize(("split", "family"), EVERY)
def test_a_texture_follows_from_its_seed_and_has_contrast(split, family):
    images = [texture_image(draw_recipe(split, np.random.default_rng(seed), family)) for seed in (3, 3, 4)]
    np.testing.assert_array_equal(images[0], images[1])
    assert np.abs(images[0] - images[2]).mean() > 0.01
    assert images[0].shape == (256, 256, 3)
    assert images[0].dtype == np.float32
    assert 0 <= images[0].min() <= images[0].max() <= 1
    assert images[0].std(axis=(0, 1)).max() > 0.02


@pytest.mark.parametrize(("split", "family"), EVERY)
def test_a_texture_continues_over_its_edges(split, family):
    image = texture_image(draw_recipe(split, np.random.default_rng(5), family))
    for axis in (0, 1):
        steps = np.abs(np.diff(image, axis=axis)).mean(axis=(1 - axis, 2))
        over_the_edge = np.abs(image.take(0, axis) - image.take(-1, axis)).mean()
        assert over_the_edge <= steps.max() + 1e-6


def test_colours_are_whole_bytes():
    image = texture_image(draw_recipe("train", np.random.default_rng(0)))
    np.testing.assert_allclose(255 * image, np.round(255 * image), atol=1e-4)


def test_an_unknown_split_or_family_is_refused_with_the_valid_names():
    with pytest.raises(ConfigError, match=r"texture split 'tset'.*test"):
        draw_recipe("tset", np.random.default_rng(0))
    with pytest.raises(ConfigError, match="'marble'"):
        draw_recipe("train", np.random.default_rng(0), "marble")
