"""Reachability fields: smooth, symmetric where the arm is, and of the sign that inverse kinematics gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import tr_grasp.cli as cli
from tr_grasp.errors import GraspError, MotionError
from tr_grasp.grasps.reachability import (
    Labeller,
    ReachabilityCfg,
    ReachabilityField,
    agreement,
    build_reachability,
    reachability_field,
    robot_key,
)
from tr_grasp.grasps.reachability import build as building
from tr_grasp.grasps.reachability.labels import Domain, border_distance, border_poses, moved
from tr_grasp.grasps.reachability.network import ArmShape, MarginNet
from tr_grasp.motion import Kinematics
from tr_grasp.robots import robot_spec

ARM = "ur5_robotiq_2f85"
SMALL = ReachabilityCfg(poses_n=8000, width=32, epochs_n=4, batch_n=512)


@pytest.fixture(scope="module")
def small_field() -> ReachabilityField:
    return build_reachability(robot_spec(ARM), SMALL)


def random_field(is_symmetric: bool) -> ReachabilityField:
    torch.manual_seed(0)
    shape = ArmShape((0.0, 0.01, -0.2), 0.1, is_symmetric)
    return ReachabilityField("any", "key", Domain(1.0, 0.0, 1.0), MarginNet(shape, 16))


def poses(n: int, seed: int = 0) -> np.ndarray:
    return Domain(1.0, -0.1, 1.0).sample(n, np.random.default_rng(seed))


def test_arms_whose_first_joint_turns_all_the_way_are_symmetric():
    symmetric = {name: ArmShape.of(Kinematics(robot_spec(name))).is_symmetric for name in (ARM, "panda", "j2s7s300")}
    assert symmetric == {ARM: True, "panda": False, "j2s7s300": True}


@settings(deadline=None, max_examples=20)
@given(st.floats(-np.pi, np.pi), st.integers(0, 1000))
def test_turning_everything_about_the_base_axis_changes_nothing_for_a_symmetric_arm(angle, seed):
    T, turn = poses(5, seed), np.eye(4)
    turn[:3, :3] = Rotation.from_euler("z", angle).as_matrix()
    np.testing.assert_allclose(random_field(True).values(turn @ T), random_field(True).values(T), atol=2e-5)


def test_the_azimuth_matters_to_an_arm_that_is_not_symmetric():
    T, turn = poses(5), np.diag([-1.0, -1.0, 1.0, 1.0])
    assert np.abs(random_field(False).values(turn @ T) - random_field(False).values(T)).max() > 1e-3


@pytest.mark.parametrize("is_symmetric", [True, False])
def test_the_gradient_is_that_of_finite_differences(is_symmetric):
    found, T, step = random_field(is_symmetric), poses(20), 1e-2
    slope = found.gradient(T)
    for k in range(6):
        twist = step * np.tile(np.eye(6)[k], (len(T), 1))
        ahead, back = moved(T, twist[:, :3], twist[:, 3:]), moved(T, -twist[:, :3], -twist[:, 3:])
        numeric = (found.values(ahead) - found.values(back)) / (2 * step)
        np.testing.assert_allclose(slope[:, k], numeric, atol=2e-3)


def test_values_have_the_shape_of_the_batch_and_nan_is_refused():
    T = poses(6).reshape(2, 3, 4, 4)
    assert random_field(True).values(T).shape == (2, 3)
    assert random_field(True).gradient(T[0, 0]).shape == (6,)
    with pytest.raises(MotionError, match="must be finite poses"):
        random_field(True).values(np.full((4, 4), np.nan))


def test_labels_know_home_the_far_and_the_floor():
    kinematics = Kinematics(robot_spec(ARM))
    home = kinematics.pose(kinematics.home_q_rad)
    far, under = home.copy(), home.copy()
    far[0, 3], under[2, 3] = 2.0, -0.08
    assert Labeller(kinematics)(np.array([home, far, under])).tolist() == [True, False, False]
    assert Labeller(kinematics, floor_m=-0.5)(under[None]).tolist() == [True]


def test_the_border_of_a_ball_is_found_and_measured():
    def inside(T):
        return np.linalg.norm(T[:, :3, 3] - [0.5, 0, 0.5], axis=1) < 0.3

    T = poses(2000)
    border = border_poses(T, inside(T), 0.3, 8, inside, np.random.default_rng(0))
    np.testing.assert_allclose(np.linalg.norm(border[:, :3, 3] - [0.5, 0, 0.5], axis=1), 0.3, atol=5e-3)
    np.testing.assert_allclose(border_distance(border[:9], border, False, 0.4), 0.0, atol=1e-6)
    assert border_distance(moved(T[:1], np.array([[9.0, 0, 0]]), np.zeros((1, 3))), border, False, 0.4).item() == 0.4


def test_even_a_small_field_has_the_right_sign_away_from_the_border(small_field):
    right, sure = agreement(small_field, robot_spec(ARM), 2000, seed=7).beyond(0.1)
    assert sure > 800
    assert right / sure > 0.9


def test_an_interrupted_build_takes_up_its_labels(small_field, tmp_path, monkeypatch):
    file = tmp_path / "labels.npz"

    def stop(stage: str, done: int, total: int) -> None:
        if stage == "epochs":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_reachability(robot_spec(ARM), SMALL, progress=stop, resume_file=file)
    monkeypatch.setattr(building.Labeller, "__call__", lambda *_: pytest.fail("a pose was labelled again"))
    resumed = build_reachability(robot_spec(ARM), SMALL, resume_file=file)
    np.testing.assert_allclose(resumed.values(poses(50)), small_field.values(poses(50)), atol=2e-2)


def test_a_file_gives_the_field_back_and_others_are_refused(small_field, tmp_path):
    path = small_field.save(tmp_path / "small.reachability.safetensors")
    again = ReachabilityField.load(path)
    np.testing.assert_array_equal(again.values(poses(20)), small_field.values(poses(20)))
    assert (again.domain, again.statistics["poses_n"]) == (small_field.domain, 8000)
    assert again.require_for(robot_spec(ARM)) is again
    with pytest.raises(GraspError, match="was made for another model"):
        again.require_for(robot_spec("ur5_rg2"))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(GraspError, match="damaged or no reachability field"):
        ReachabilityField.load(path)
    with pytest.raises(GraspError, match="no reachability field at"):
        reachability_field(tmp_path / "none.safetensors")
    with pytest.raises(GraspError, match="did you mean 'ur5_robotiq_2f85'"):
        reachability_field("ur5_robotiq_2f58")


def test_the_key_tells_hands_apart():
    assert robot_key(robot_spec(ARM)) == robot_key(replace(robot_spec(ARM)))
    assert robot_key(robot_spec(ARM)) != robot_key(robot_spec("ur5_rg2"))


def test_the_shipped_field_fits_its_arm_and_agrees_with_inverse_kinematics():
    found = reachability_field(ARM)
    right, sure = agreement(found, robot_spec(ARM), 4000, seed=3).beyond(0.02)
    assert sure > 3600
    assert right / sure > 0.99


def test_the_command_builds_shows_and_answers(tmp_path, capsys):
    out, picture = tmp_path / "new" / "f.reachability.safetensors", tmp_path / "slices.png"
    flags = ["--build.poses-n", "4000", "--build.epochs-n", "2", "--build.width", "16"]
    assert cli.main(["reachability", "build", ARM, "--out", str(out), *flags]) == 0
    assert [path.name for path in out.parent.iterdir()] == [out.name]
    assert cli.main(["reachability", "build", ARM, "--out", str(out), *flags]) == 2
    assert cli.main(["reachability", "show", str(out), "--poses-n", "200", "--picture", str(picture)]) == 0
    assert picture.stat().st_size > 10_000
    capsys.readouterr()
    assert cli.main(["reachability", "query", ARM, "0.5", "0", "0.24"]) == 0
    first, *_, last = capsys.readouterr().out.splitlines()
    assert first.endswith(" mm, reachable")
    assert last == "inverse kinematics says reachable"


@pytest.mark.parametrize(
    ("args", "sentence"),
    [
        (["bild"], "unknown verb of reachability 'bild'; did you mean 'build'?"),
        (["build", "ur6"], "ur6"),
        (["build", ARM, "--build.poses-n", "0"], "poses_n must be positive, got 0"),
        (["query", ARM, "0", "0", "0", "--q-wxyz", "0", "0", "0", "0"], "must be a quaternion that is not zero"),
    ],
)
def test_a_mistake_is_one_sentence(args, sentence, capsys):
    assert cli.main(["reachability", *args]) == 2
    assert sentence in capsys.readouterr().err
