"""Calibrations as files, and the sample files of MoveIt Calibration and easy_handeye in the form that those write."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import Rotation

from tests.calibration.conftest import make_world
from tr_grasp.calibration import (
    CalibrationRecord,
    Frames,
    Sample,
    Setup,
    load_calibration,
    read_samples,
    save_calibration,
    solve_hand_eye,
    static_transform,
)
from tr_grasp.calibration.rigid import Array, distance_m
from tr_grasp.errors import CalibrationError
from tr_grasp.geometry import invert_transform


def moveit(samples: list[Sample]) -> list[dict]:
    """A list of pairs of matrices, 16 numbers row by row."""
    return [
        {"effector_wrt_world": s.T_base_tcp.ravel().tolist(), "object_wrt_sensor": s.T_cam_board.ravel().tolist()}
        for s in samples
    ]


def ros_transform(T: Array) -> dict:
    """As rospy_message_converter writes a geometry_msgs/Transform."""
    x, y, z, w = (float(v) for v in Rotation.from_matrix(T[:3, :3]).as_quat())
    return {
        "translation": dict(zip("xyz", T[:3, 3].tolist(), strict=True)),
        "rotation": {"x": x, "y": y, "z": z, "w": w},
    }


def easy_handeye(samples: list[Sample], setup: Setup, camera_key: str = "optical") -> dict:
    """Transforms of ROS; with the camera beside the robot that tool samples the base as seen from the hand."""
    return {
        "parameters": {
            "name": "lab",
            "calibration_type": setup,
            "robot_base_frame": "base_link",
            "robot_effector_frame": "tool0",
            "tracking_base_frame": "camera_link",
            "tracking_marker_frame": "board",
        },
        "samples": [
            {
                "robot": ros_transform(s.T_base_tcp if setup == "eye_in_hand" else invert_transform(s.T_base_tcp)),
                camera_key: ros_transform(s.T_cam_board),
            }
            for s in samples
        ],
    }


def same(pairs: list[tuple[Array, Array]], samples: list[Sample]) -> bool:
    return all(
        np.allclose(T, s.T_base_tcp, atol=1e-9) and np.allclose(seen, s.T_cam_board, atol=1e-9)
        for (T, seen), s in zip(pairs, samples, strict=True)
    )


@pytest.mark.parametrize("camera_key", ["optical", "tracking"])
def test_samples_of_easy_handeye_are_read(tmp_path: Path, setup: Setup, camera_key: str) -> None:
    world = make_world(setup, 4)
    path = tmp_path / "lab.samples"
    path.write_text(yaml.safe_dump(easy_handeye(world.samples, setup, camera_key)))
    said, pairs = read_samples(path)
    assert said == setup
    assert same(pairs, world.samples)


@pytest.mark.parametrize("on_hand", [True, False])
def test_older_files_of_easy_handeye_say_the_setup_in_another_way(tmp_path: Path, on_hand: bool) -> None:
    setup: Setup = "eye_in_hand" if on_hand else "eye_on_base"
    content = {**easy_handeye(make_world(setup, 3).samples, setup), "parameters": {"eye_on_hand": on_hand}}
    path = tmp_path / "lab.yaml"
    path.write_text(yaml.safe_dump(content))
    assert read_samples(path)[0] == setup
    with pytest.raises(CalibrationError, match=f"was taken {setup}"):
        read_samples(path, "eye_on_base" if on_hand else "eye_in_hand")


@pytest.mark.parametrize("write", [json.dumps, yaml.safe_dump])
def test_samples_of_moveit_are_read(tmp_path: Path, setup: Setup, write) -> None:
    world = make_world(setup, 4)
    path = tmp_path / "samples.yaml"
    path.write_text(write(moveit(world.samples)))
    said, pairs = read_samples(path, setup)
    assert said == setup
    assert same(pairs, world.samples)
    assert read_samples(path)[0] is None  # that tool does not say it


def test_a_camera_found_from_the_file_is_where_it_is(tmp_path: Path, setup: Setup) -> None:
    world = make_world(setup, 5)
    path = tmp_path / "lab.yaml"
    path.write_text(yaml.safe_dump(easy_handeye(world.samples, setup)))
    _, pairs = read_samples(path)
    samples = [Sample(str(i), *pair) for i, pair in enumerate(pairs)]
    assert distance_m(solve_hand_eye(samples, setup).T_parent_cam, world.X) < 1e-6


def damaged(change) -> str:
    content = easy_handeye(make_world("eye_in_hand", 3).samples, "eye_in_hand")
    change(content)
    return yaml.safe_dump(content)


def damaged_moveit(change) -> str:
    content = moveit(make_world("eye_in_hand", 3).samples)
    change(content)
    return yaml.safe_dump(content)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("samples: [", "lab.yaml"),
        ("just: words", "holds no samples"),
        (damaged(lambda c: c["samples"][1]["robot"]["translation"].pop("y")), "sample 2 of"),
        (damaged(lambda c: c["samples"][2]["optical"].pop("rotation")), "optical needs translation x, y, z"),
        (damaged(lambda c: c["samples"][0]["robot"]["rotation"].update(w=3.0)), "has no length of 1"),
        (damaged(lambda c: c.pop("parameters")), "does not say where the camera was"),
        (damaged_moveit(lambda c: c[1]["effector_wrt_world"].pop()), "sample 2 of"),
        (damaged_moveit(lambda c: c[2].pop("object_wrt_sensor")), "object_wrt_sensor must hold 16 numbers"),
        (damaged_moveit(lambda c: c[0]["object_wrt_sensor"].__setitem__(0, 5.0)), "is not rigid"),
        (
            damaged_moveit(lambda c: c[0]["object_wrt_sensor"].__setitem__(3, float("nan"))),
            "must be a finite",
        ),
    ],
)
def test_a_damaged_file_is_refused_and_the_sample_is_named(tmp_path: Path, text: str, sentence: str) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text(text)
    with pytest.raises(CalibrationError, match=re.escape(sentence)):
        read_samples(path)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"none\.yaml"):
        read_samples(tmp_path / "none.yaml")
    with pytest.raises(CalibrationError, match=r"none\.yaml"):
        load_calibration(tmp_path / "none.yaml")


def test_a_calibration_is_the_same_after_a_visit_to_a_file(tmp_path: Path, setup: Setup) -> None:
    result = solve_hand_eye(make_world(setup, 6, 3, 0.1, (5e-4, 2e-3)).samples, setup, draws_n=50)
    path = save_calibration(result, Frames(base="base_link", tcp="tool0", cam="optical"), tmp_path / "lab.yaml")
    record = load_calibration(path)
    np.testing.assert_allclose(record.T_parent_cam, result.T_parent_cam, atol=1e-8)
    assert record.translation_95_m == pytest.approx(result.uncertainty.translation_m)
    assert record.samples_n == 6
    written = yaml.safe_load(path.read_text())
    assert np.array(written[result.name]).shape == (4, 4)
    assert np.array(written[result.board_name]).shape == (4, 4)
    assert f"--frame-id {'base_link' if setup == 'eye_on_base' else 'tool0'} --child-frame-id optical" in (
        static_transform(record)
    )


def test_a_static_transform_worked_by_hand() -> None:
    # A quarter turn about z: w = z = sqrt(1/2).
    rows = ((0.0, -1.0, 0.0, 0.5), (1.0, 0.0, 0.0, -0.25), (0.0, 0.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0))
    assert static_transform(CalibrationRecord(T_base_cam=rows)) == (
        "ros2 run tf2_ros static_transform_publisher --x 0.500000 --y -0.250000 --z 1.000000 "
        "--qx 0.0000000 --qy 0.0000000 --qz 0.7071068 --qw 0.7071068 --frame-id base --child-frame-id cam"
    )


def test_a_calibration_without_its_matrix_or_with_a_bent_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "lab.yaml"
    path.write_text("setup: eye_in_hand\n")
    with pytest.raises(CalibrationError, match="has no T_tcp_cam, which eye_in_hand needs"):
        load_calibration(path)
    path.write_text("T_base_cam: [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n")
    with pytest.raises(CalibrationError, match="is not rigid"):
        load_calibration(path)
