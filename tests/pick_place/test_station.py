"""Stations as data: what the thesis' file says, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tr_grasp.configs.io import read_mapping
from tr_grasp.errors import ConfigError
from tr_grasp.motion import inverse_kinematics
from tr_grasp.pick_place import BoxCfg, PlanningScene, read_station, station_names
from tr_grasp.pick_place.station_file import _SHIPPED, station_from


@pytest.fixture
def content():
    return read_mapping(_SHIPPED / "thesis.yaml", "thesis")


def test_the_nine_stages_are_those_of_the_thesis():
    names = [stage.name for stage in read_station("thesis").stages]
    expected = ["home", "pre-grasp", "grasp", "close", "post-grasp", "place", "open", "post-place", "home again"]
    assert names == expected
    assert "thesis" in station_names()


def test_the_quaternion_is_read_with_its_scalar_last():
    """As xyzw the hand approaches along -y, worked out by hand: R z = 2 (xz + wy, yz - wx, ...)."""
    T = read_station("thesis").T_base_link("grasp")
    x, y, z, w = 0.7158, -0.0893, 0.0541, 0.6904
    assert T[:3, 3] == pytest.approx([-0.2962, -0.5724, 0.1354])
    assert T[:3, 2] == pytest.approx([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], abs=2e-3)
    assert T[1, 2] < -0.99


def test_a_derived_pose_is_drawn_back_along_the_approach():
    cfg = read_station("thesis")
    grasp, before = cfg.T_base_link("grasp"), cfg.T_base_link("pre_grasp")
    assert before[:3, 3] == pytest.approx(grasp[:3, 3] - 0.12 * grasp[:3, 2])
    assert before[:3, :3] == pytest.approx(grasp[:3, :3])


def test_the_tool_goes_where_the_named_link_has_to_be():
    cfg = read_station("thesis")
    scene = PlanningScene(cfg)
    T_tcp_end = np.linalg.inv(scene.empty_hand.pose(scene.home_q)) @ scene.empty_hand.link_pose(
        scene.home_q, cfg.pose_link
    )
    assert scene.goal("place") @ T_tcp_end == pytest.approx(cfg.T_base_link("place"), abs=1e-9)
    assert scene.goal("home") == pytest.approx(cfg.home_q_rad)


def test_what_a_box_is_grown_by_keeps_the_hand_away_from_it():
    """A plate 5 cm in front of the tcp at the grasp, where the hand points along -y."""
    thesis = read_station("thesis")
    x, y, z = PlanningScene(thesis).goal("grasp")[:3, 3]
    free = []
    for margin_m in (0.0, 0.07):
        plate = BoxCfg((0.2, 0.01, 0.2), (float(x), float(y) - 0.05, float(z)), margin_m=margin_m)
        scene = PlanningScene(replace(thesis, boxes={"plate": plate}, not_to_touch=()))
        q = inverse_kinematics(scene.empty_hand, scene.goal("grasp"), scene.home_q).q_rad
        free.append(bool(np.all(scene.at_object.free(q.reshape(1, -1)))))
    assert free == [True, False]


def test_an_object_seen_elsewhere_moves_the_grasp_and_nothing_else():
    cfg = read_station("thesis")
    moved = cfg.with_grasp_shifted((0.02, -0.01, 0.0)).with_object_at(-0.28, -0.59)
    for name in ("grasp", "pre_grasp", "post_grasp"):
        shift = moved.T_base_link(name)[:3, 3] - cfg.T_base_link(name)[:3, 3]
        assert shift == pytest.approx([0.02, -0.01, 0.0])
    assert moved.T_base_link("place") == pytest.approx(cfg.T_base_link("place"))
    assert moved.object.foot_m == (-0.28, -0.59, 0.0)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("poses", "grasp", "orientation_xyzw"), [1.0, 1.0, 0.0, 0.0], "unit quaternion"),
        (("poses", "grasp", "position_m"), [1.0, 2.0], "list of 3"),
        (("poses", "grasp", "orientation"), [0, 0, 0, 1], "did you mean 'orientation_xyzw'"),
        (("poses", "pre_grasp", "like"), "grsp", "did you mean 'grasp'"),
        (("poses", "pre_grasp", "like"), "pre_grasp", "derived from itself"),
        (("poses", "pre_grasp"), {"position_m": [0, 0, 0]}, "position_m and orientation_xyzw, or like"),
        (("stages", 2, "to"), "grap", "did you mean 'grasp'"),
        (("stages", 2, "do"), "jump", "one of"),
        (("stages", 3, "do"), "open", "close the fingers once"),
        (("boxes", "left wall", "size_m"), [1.0, 0.0, 1.0], "size_m must be positive"),
        (("boxes", "carton back", "margin_m"), -0.01, "margin_m must not be negative"),
        (("not_to_touch",), ["left wal"], "did you mean 'left wall'"),
        (("object", "radius_m"), -1, "radius_m must be positive"),
        (("speed_share",), 2.0, "speed_share"),
        (("goal_m",), [[0, 0, 0], [1, -1, 1]], "lowest and a highest corner"),
        (("robott",), "panda", "robott"),
    ],
)
def test_a_mistake_in_a_file_is_one_sentence_with_its_place(content, path, value, message):
    inner = content
    for name in path[:-1]:
        inner = inner[name]
    inner[path[-1]] = value
    with pytest.raises(ConfigError, match=message) as error:
        station_from(content, "mine.yaml")
    assert str(error.value).startswith("mine.yaml")
    assert "\n" not in str(error.value)


def test_an_unknown_station_or_robot_is_refused_by_name():
    with pytest.raises(ConfigError, match="unknown station 'thesys'; did you mean 'thesis'"):
        read_station("thesys")
    with pytest.raises(ConfigError, match="robot"):
        PlanningScene(replace(read_station("thesis"), robot="kinova"))
    with pytest.raises(ConfigError, match="home_q_rad must have the 7 joints"):
        PlanningScene(replace(read_station("thesis"), home_q_rad=(0.0,)))
    with pytest.raises(ConfigError, match="unknown link"):
        PlanningScene(replace(read_station("thesis"), pose_link="hand"))
