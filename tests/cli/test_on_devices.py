"""``pick-place`` and ``run`` on devices, whole: the dry run, the question, the motion, and what goes wrong in it."""

from __future__ import annotations

import io
import json
import sys
import threading

import numpy as np
import pytest

pytest.importorskip("roslibpy")

from tests.cli.benches import BENCHES, fail_in_motion, panda_bench, recorded_table, station_file
from tr_grasp.cli import main
from tr_grasp.deploy import RunLog
from tr_grasp.hardware import devices

STAGES = ["pre-grasp", "grasp", "close", "post-grasp", "place", "open", "post-place", "home again"]


@pytest.fixture
def answer(monkeypatch):
    return lambda text: monkeypatch.setattr(sys, "stdin", io.StringIO(text))


@pytest.fixture
def opened(monkeypatch):
    """Lets ``open_station`` give a bench, and closes it; says with which names it was asked for."""
    asked, made = [], []

    def use(bench):
        made.append(bench)
        monkeypatch.setattr(devices, "open_station", lambda *names, **more: (asked.append((names, more)), bench)[1])
        return bench

    use.asked = asked
    yield use
    for bench in made:
        if hasattr(bench.fake, "server"):
            bench.fake.server.close()


def pick_place(folder, arm, *more):
    robot, _ = BENCHES[arm]
    gripper = [] if arm != "ur5" else ["--gripper", "robotiq_2f85"]
    names = ["--station", str(station_file(folder, robot)), "--arm", arm, *gripper, "--device", "arm_host=here"]
    return main(["pick-place", *names, "--out", str(folder / "stages.jsonl"), *more])


def stages_of(folder):
    return [json.loads(line) for line in (folder / "stages.jsonl").read_text().splitlines()]


def stands_still(bench):
    """Whether the device itself, asked past its adapter, no longer moves."""
    fake = bench.fake
    if hasattr(fake, "server"):  # its bridge has hung up, but the driver goes on
        driver = fake.server.driver
        for _ in range(200):  # the network is real
            if driver.stopped:
                break
            threading.Event().wait(0.01)
        before = driver.q.copy()
        for _ in range(50):
            driver.cycle()
        return np.array_equal(driver.q, before)
    name = "true_q" if hasattr(fake, "true_q") else "q"
    bench.world.wait(0.5)
    before = getattr(fake, name).copy()
    bench.world.wait(0.1)
    return float(np.abs(getattr(fake, name) - before).max()) < 1e-4


@pytest.mark.parametrize("arm", BENCHES)
def test_a_confirmed_task_is_rehearsed_and_then_carried_out_stage_by_stage(arm, tmp_path, answer, opened, capsys):
    bench = opened(BENCHES[arm][1]())
    answer("y\n")
    assert pick_place(tmp_path, arm) == 0
    said = capsys.readouterr().out
    assert said.index("Dry run") < said.index("pre-grasp    done") < said.index("all stages were carried out")
    assert [row["name"] for row in stages_of(tmp_path)] == STAGES
    assert not any(row["reason"] for row in stages_of(tmp_path))
    ((names, more),) = opened.asked
    assert (names[0], more) == (arm, {"arm_host": "here"})
    assert bench.gripper.opening_range_m[1] > 0.05


@pytest.mark.parametrize("text", ["n\n", "\n", ""])
def test_without_a_yes_no_device_is_even_opened(text, tmp_path, answer, opened, capsys):
    opened(panda_bench())
    answer(text)
    assert pick_place(tmp_path, "panda") == 1
    assert "nothing was moved" in capsys.readouterr().out
    assert opened.asked == []


FAILURES = [
    ("panda", lambda robot: setattr(robot, "pressed", True), "user stop"),
    ("panda", lambda robot: setattr(robot, "lost", True), "Timeout"),
    ("ur5", lambda box: setattr(box, "emergency", True), "emergency stop"),
    ("ur5", lambda box: setattr(box, "connected", False), "not connected"),
    ("j2s7s300", lambda lab: setattr(lab.server.driver, "silent", True), "s old"),
    ("j2s7s300", lambda lab: lab.server.driver.on_service("/j2s7s300_driver/in/stop"), "told to be"),
]


@pytest.mark.parametrize(("arm", "cause", "words"), FAILURES)
def test_what_goes_wrong_in_motion_stops_the_arm_and_is_on_record(arm, cause, words, tmp_path, answer, opened, capsys):
    bench = opened(BENCHES[arm][1]())
    fail_in_motion(bench, cause)
    answer("y\n")
    assert pick_place(tmp_path, arm) == 1
    said = capsys.readouterr().out
    assert words in said.splitlines()[-1]
    assert stands_still(bench)
    rows = stages_of(tmp_path)
    assert words in rows[-1]["reason"]
    assert len(rows) < len(STAGES)


def test_a_device_that_is_not_there_is_one_sentence(tmp_path, answer, capsys):
    answer("y\n")
    nobody = ["--device", "arm_host=127.0.0.1", "arm_port=1", "arm_timeout_s=0.2"]
    names = ["--station", str(station_file(tmp_path, "j2s7s300")), "--arm", "j2s7s300", *nobody]
    assert main(["pick-place", *names]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert "no rosbridge answers at 127.0.0.1:1" in error


def test_a_dry_run_on_a_device_opens_nothing(tmp_path, opened, capsys):
    opened(panda_bench())
    assert pick_place(tmp_path, "panda", "--dry-run", "True") == 0
    assert "8 stages" in capsys.readouterr().out
    assert opened.asked == []


def test_a_station_of_another_robot_is_refused_before_anything_is_opened(tmp_path, opened, capsys):
    opened(panda_bench())
    station = station_file(tmp_path, "j2s7s300")
    assert main(["pick-place", "--station", str(station), "--arm", "panda", "--device", "arm_host=here"]) == 2
    assert "the station is for j2s7s300, --arm panda makes panda" in capsys.readouterr().err
    assert opened.asked == []


# ---- policies --------------------------------------------------------------------------------------------------


def run_policy(folder, camera, steps=3):
    names = ["--arm", "panda", "--camera", "realsense", "--camera-pose", str(camera), "--device", "arm_host=here"]
    return main(["run", "panda", *names, "--steps", str(steps), "--log", str(folder / "logs")])


def test_a_confirmed_policy_acts_on_what_the_camera_sees_and_leaves_its_log(tmp_path, answer, opened, capsys):
    picture, camera = recorded_table(tmp_path)
    bench = opened(panda_bench(picture))
    before = bench.fake.true_q.copy()
    answer("yes\n")
    assert run_policy(tmp_path, camera) == 1  # three steps lift nothing
    assert "half a step along every axis keeps the rules" in capsys.readouterr().out
    log = RunLog.load(tmp_path / "logs" / "panda.npz")
    assert [len(log.steps), log.meta["ending"]] == [3, "TIME_UP"]
    assert np.isfinite(log.steps[0].depth_m).any()
    assert np.abs(bench.fake.true_q - before).max() > 0.01
    assert stands_still(bench)
    assert main(["run", "--replay", str(tmp_path / "logs" / "panda.npz")]) == 0


def test_a_policy_without_a_yes_moves_nothing(tmp_path, answer, opened):
    picture, camera = recorded_table(tmp_path)
    opened(panda_bench(picture))
    answer("no\n")
    assert run_policy(tmp_path, camera) == 1
    assert opened.asked == []
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize(("name", "words"), [("pressed", "user stop"), ("lost", "Timeout")])
def test_a_policy_whose_arm_fails_is_stopped_and_its_log_is_kept(name, words, tmp_path, answer, opened, capsys):
    picture, camera = recorded_table(tmp_path)
    bench = opened(panda_bench(picture))
    fail_in_motion(bench, lambda robot: setattr(robot, name, True))
    answer("y\n")
    assert run_policy(tmp_path, camera, steps=20) == 1
    assert words in capsys.readouterr().out.splitlines()[-1]
    log = RunLog.load(tmp_path / "logs" / "panda.npz")
    assert log.meta["ending"] == "FAILED"
    assert 1 <= len(log.steps) < 20
    assert stands_still(bench)


def test_a_camera_that_is_pulled_out_ends_the_run(tmp_path, answer, opened, capsys):
    picture, camera = recorded_table(tmp_path)
    bench = opened(panda_bench(picture))
    fail_in_motion(bench, lambda _: setattr(bench.camera._rs, "plugged", False))
    answer("y\n")
    assert run_policy(tmp_path, camera, steps=20) == 1
    assert "camera" in capsys.readouterr().out.splitlines()[-1]
    assert stands_still(bench)
