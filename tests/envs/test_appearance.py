"""Looks are drawn apart from everything else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torchrl.envs import check_env_specs

from tr_grasp import keys
from tr_grasp.configs import AppearanceCfg, CameraCfg, EnvCfg, ObjectsCfg, ObservationCfg, RandomisationCfg
from tr_grasp.envs import make_env
from tr_grasp.envs.appearance import draw_look, tinted_models
from tr_grasp.errors import ConfigError
from tr_grasp.modules import ImageCNN, StackedEncoder, rgbd_image
from tr_grasp.objects import object_set
from tr_grasp.sensing import RaycastCamera
from tr_grasp.sensing.look import Look

pytestmark = pytest.mark.sim
ONE = ObjectsCfg(count_range=(1, 1))
SWITCHES = ("ground_texture", "table_colour", "object_tint", "light")


def looking(*switches: str, **fields) -> EnvCfg:
    return EnvCfg(objects=ONE, randomise=RandomisationCfg(**dict.fromkeys(switches, True)), **fields)


def test_with_everything_off_the_look_is_plain():
    look, models = draw_look(looking(), 7), [object_set("procedural", "train").sample(np.random.default_rng(0))]
    assert look == Look()
    assert tinted_models(looking(), 7, models)[0] is models[0]


def test_a_look_follows_from_the_seed_of_its_episode():
    cfg = looking(*SWITCHES)
    first, again, other = draw_look(cfg, 7), draw_look(cfg, 7), draw_look(cfg, 8)
    np.testing.assert_array_equal(first.ground.image, again.ground.image)
    np.testing.assert_array_equal(first.light.to_sun, again.light.to_sun)
    assert np.abs(first.ground.image - other.ground.image).mean() > 0.01
    assert first.light.sun != other.light.sun


def test_one_switch_leaves_what_another_draws_alone():
    alone, together = draw_look(looking("light"), 7), draw_look(looking(*SWITCHES), 7)
    assert (alone.light.sun, alone.light.ambient) == (together.light.sun, together.light.ambient)
    assert alone.ground is None
    texture, coloured = draw_look(looking("ground_texture"), 7).ground, together.ground
    assert (texture.side_m, texture.yaw_rad) == (coloured.side_m, coloured.yaw_rad)


def test_ranges_are_kept_and_a_textured_table_has_the_drawn_colour_on_average():
    ranges = AppearanceCfg(
        texture_side_m=(0.4, 0.5), table_value=(0.3, 0.3), table_saturation=(0, 0), light_elevation_rad=(1.0, 1.1)
    )
    for seed in range(8):
        look = draw_look(looking(*SWITCHES, appearance=ranges), seed)
        assert 0.4 <= look.ground.side_m <= 0.5
        np.testing.assert_allclose(look.ground.image.mean(axis=(0, 1)), 0.3, atol=0.03)
        assert np.sin(1.0) <= look.light.to_sun[2] <= np.sin(1.1)
        np.testing.assert_allclose(np.linalg.norm(look.light.to_sun), 1)


def test_test_objects_lie_on_test_textures_unless_asked_otherwise(monkeypatch):
    asked = []
    monkeypatch.setattr("tr_grasp.envs.appearance.draw_ground", lambda split, *_: asked.append(split))
    cfg = looking("ground_texture")
    draw_look(cfg, 0)
    draw_look(replace(cfg, objects=replace(ONE, split="test")), 0)
    draw_look(replace(cfg, appearance=AppearanceCfg(texture_split="test")), 0)
    assert asked == ["train", "test", "test"]


def test_a_tint_keeps_shapes_and_changes_colours():
    model = object_set("procedural", "train").sample(np.random.default_rng(0))
    (tinted,) = tinted_models(looking("object_tint"), 7, [model])
    assert tinted.visual is model.visual
    assert np.abs(tinted.face_colours - model.face_colours).max() > 0.02
    assert 0 <= tinted.face_colours.min() <= tinted.face_colours.max() <= 1


@pytest.mark.parametrize(
    ("field", "value", "sentence"),
    [
        ("texture_side_m", (0.5, 0.3), "appearance.texture_side_m must be 0.05 <= low <= high"),
        ("table_hue", (0.0, 1.5), "appearance.table_hue must be 0 <= low <= high <= 1"),
        ("light_elevation_rad", (1.0, 2.0), "appearance.light_elevation_rad must be 0 <= low <= high <= 1.571"),
    ],
)
def test_a_range_that_makes_no_sense_is_refused(field, value, sentence):
    with pytest.raises(ConfigError, match=sentence):
        AppearanceCfg(**{field: value})


def test_looks_change_the_colours_of_an_episode_and_nothing_else():
    cfgs = [looking(), looking(*SWITCHES)]
    runs = []
    for cfg in cfgs:
        env = make_env(replace(cfg, observation=ObservationCfg(expert_labels=True, stack_n=1)), seed=3)
        runs.append(env.rollout(4, lambda td: td.set(keys.ACTION, td[keys.EXPERT_ACTION])))
        env.close()
    plain, dressed = runs
    for key in (keys.PROPRIO, keys.ACTION, ("next", "reward")):
        assert torch.equal(plain[key], dressed[key])
    assert torch.equal(plain[keys.OCTREE].codes, dressed[keys.OCTREE].codes)
    shape, colour = slice(0, 4), slice(4, 7)
    features = plain[keys.OCTREE].features, dressed[keys.OCTREE].features
    assert torch.equal(features[0][..., shape], features[1][..., shape])
    assert (features[0][..., colour] - features[1][..., colour]).abs().float().mean() > 0.005


def test_pictures_are_an_observation_that_an_image_encoder_reads():
    camera = CameraCfg(image_size_px=32)
    env = make_env(looking("ground_texture", camera=camera, observation=ObservationCfg(image=True, stack_n=2)), seed=1)
    check_env_specs(env)
    td = env.reset()
    colour, depth = td[keys.COLOUR_IMAGE], td[keys.DEPTH_IMAGE]
    assert (colour.shape, colour.dtype) == ((2, 3, 32, 32), torch.uint8)
    assert (depth.shape, depth.dtype) == ((2, 1, 32, 32), torch.float32)
    view = env.task.view
    whole = RaycastCamera(view.raycast, view.camera, look=view.look).capture(view.poses())
    np.testing.assert_allclose(depth[-1, 0], whole.depth, atol=0.006)  # six standard deviations of the noise
    np.testing.assert_allclose(colour[-1] / 255, np.moveaxis(whole.colour, -1, 0), atol=0.003)
    encoder = StackedEncoder(lambda: ImageCNN(features_n=16), stack_n=2, shared=True)
    assert encoder(rgbd_image(colour, depth)[None], td[keys.PROPRIO][None]).shape == (1, 32)
    env.close()


def test_a_photograph_without_a_renderer_is_refused():
    env = make_env(looking())
    if not env.task.scene.can_render():
        with pytest.raises(ConfigError, match="photographs=True"):
            env.task.photograph(32)
    env.close()


@pytest.mark.render
@pytest.mark.parametrize("switches", [(), ("object_tint",), ("table_colour", "light"), SWITCHES[:3]])
def test_both_cameras_see_the_same(switches):
    cfg = looking(*switches, camera=CameraCfg(backend="sapien", image_size_px=96))
    env = make_env(replace(cfg, objects=ObjectsCfg(count_range=(4, 4))), seed=2)
    env.reset()
    view = env.task.view
    rendered = view.capture()
    cast = RaycastCamera(view.raycast, view.camera, look=view.look).capture(view.poses())
    both = np.isfinite(rendered.depth) & np.isfinite(cast.depth)
    assert both.mean() > 0.99
    assert (np.abs(rendered.depth - cast.depth)[both] < 0.0015).mean() > 0.99
    difference = np.abs(rendered.colour - cast.colour).max(axis=-1)
    if "ground_texture" in switches:  # which both filter, each in its way
        assert difference.mean() < 0.03
        assert np.abs(rendered.colour.mean(axis=(0, 1)) - cast.colour.mean(axis=(0, 1))).max() < 0.01
    else:
        assert np.quantile(difference, 0.98) < 0.01
    env.close()


@pytest.mark.render
def test_a_photograph_shows_the_scene_and_changes_no_episode():
    seen = []
    for photographs in (True, False):
        env = make_env(looking("ground_texture"), seed=5, photographs=photographs)
        env.reset()
        if photographs:
            photograph, picture = env.task.photograph(64) / 255, env.task.render_image(64) / 255
            assert np.corrcoef(photograph.ravel(), picture.ravel())[0, 1] > 0.7
        td = env.step(env.rand_action(env.reset()).set(keys.ACTION, torch.tensor([0.1, 0.2, -0.3, 0.4, 1.0])))
        seen.append(td["next", keys.PROPRIO])
        env.close()
    assert torch.equal(*seen)
