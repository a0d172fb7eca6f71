"""Whole runs on a kinematic station in virtual time: what is met, what is recognised as hopeless, and when."""

from __future__ import annotations

import numpy as np
import pytest

from tests.dynamic.stations import arm, at, line, scene
from tr_grasp.dynamic import DynamicGrasper, DynamicMethod, GrasperCfg, GraspOutcome, Phase
from tr_grasp.dynamic.attempt import Run
from tr_grasp.dynamic.hopeless import hopeless
from tr_grasp.dynamic.meeting import Found
from tr_grasp.errors import ConfigError, GraspError
from tr_grasp.hardware import Follower, PoseStreamCfg
from tr_grasp.motion import box


def run(path, cfg: GrasperCfg | None = None, **given):
    station, task = scene(path, **given)
    return DynamicGrasper(cfg).run(station, task), station


def test_it_is_a_method_and_says_what_it_does() -> None:
    told: list[Phase] = []
    result, _station = run(line(), told=told)
    assert isinstance(DynamicGrasper(), DynamicMethod)
    assert result.outcome is GraspOutcome.LIFTED
    assert result.attempts == 1
    assert told == [Phase.REACHING, Phase.APPROACHING, Phase.CLOSING, Phase.LIFTING, Phase.HOLDING]
    assert result.committed_s is not None
    assert result.lifted_s is not None
    assert result.committed_s < 2.0 < result.lifted_s < 5.0
    assert result.loops / result.committed_s > 20  # plans a second, in the time of the world


def test_a_circle_whose_centre_nobody_tells_and_a_sine_are_met() -> None:
    def circle(times):
        angle = 0.05 * np.asarray(times)
        return 0.6 * np.stack([np.cos(angle), np.sin(angle)], 1), np.full(len(angle), 0.3)

    def sine(times):
        y = -0.5 + 0.03 * np.asarray(times)
        return np.stack([0.5 + 0.125 * np.sin(6 * np.pi * y), y], 1), np.full(len(y), 0.3)

    for path in (circle, sine):
        assert run(path)[0].outcome is GraspOutcome.LIFTED


def test_the_hand_is_at_the_object_when_the_fingers_close() -> None:
    """At 10 cm/s half a second's delay would be 5 cm; the fingers close within 5 mm of the grasp."""
    station, task = scene(line((0.5, -0.5), (0.0, 0.1)))
    gaps: list[float] = []

    def told(phase: Phase) -> None:
        if phase is Phase.CLOSING:
            T_obj = at(0.5, -0.5 + 0.1 * station.world.now_s, 0.0)
            tool = arm().pose(station.arm.state().q_rad)
            c, s = np.cos(0.7), np.sin(0.7)
            T_obj[:2, :2] = [[c, -s], [s, c]]
            T_obj[2, 3] = task.T_target_carrier[2, 3] * -1 + 0.01
            grasps = T_obj @ task.grasps.grasps.poses()
            gaps.append(float(np.linalg.norm(grasps[:, :3, 3] - tool[:3, 3], axis=1).min()))

    object.__setattr__(task, "tell", told)
    assert DynamicGrasper().run(station, task).outcome is GraspOutcome.LIFTED
    assert len(gaps) == 1
    assert gaps[0] < 0.005


def test_what_stays_far_away_is_recognised_long_before_its_path_ends() -> None:
    result, station = run(line((2.0, 0.0), (0.0, 0.03)), path_end_s=30.0)
    assert result.outcome is GraspOutcome.UNREACHABLE
    assert "further than 1 m" in result.detail
    assert station.world.now_s < 3.0


def test_what_is_faster_than_the_arm_is_recognised() -> None:
    """It is within reach for two seconds, and gone before a tenth of the rated speed could get there."""
    result, station = run(line((0.45, -0.4), (0.0, 0.8)), GrasperCfg(limits="thesis"), path_end_s=60.0)
    assert result.outcome is GraspOutcome.UNREACHABLE
    assert station.world.now_s < 6.0


def test_a_target_that_leaps_is_met_where_it_went() -> None:
    def leap(times):
        xy, yaw = line()(times)
        return xy + np.where(np.asarray(times) > 0.5, 0.25, 0.0)[:, None] * [0.0, 1.0], yaw

    assert run(leap)[0].outcome is GraspOutcome.LIFTED


def test_late_noisy_and_missing_readings_are_no_obstacle() -> None:
    result, _ = run(line(), stream=PoseStreamCfg(rate_hz=30, latency_s=0.1, noise_m=0.001, dropout_share=0.3, seed=3))
    assert result.outcome is GraspOutcome.LIFTED


def test_a_target_that_is_never_seen_is_lost() -> None:
    result, station = run(line(), stream=PoseStreamCfg(dropout_share=1.0))
    assert result.outcome is GraspOutcome.LOST
    assert "no reading for" in result.detail
    assert station.world.now_s < 2.2


def test_fingers_that_close_on_air_try_again_and_then_say_so() -> None:
    result, _ = run(line(), GrasperCfg(attempts_n=2), width_m=None)
    assert result.outcome is GraspOutcome.MISSED
    assert result.attempts == 2
    result, _ = run(line(), GrasperCfg(retry=False), width_m=None)
    assert result.outcome is GraspOutcome.MISSED
    assert result.attempts == 1


def test_what_does_not_rise_with_the_hand_has_slipped() -> None:
    result, _ = run(line(), GrasperCfg(retry=False), holds=False)
    assert result.outcome is GraspOutcome.SLIPPED


def test_an_arm_boxed_in_ends_with_the_reason() -> None:
    """Walls all around the path: every grasp touches them, so no time-out is waited for."""
    walls = tuple(box(f"wall {x}", (0.02, 2.0, 0.8), at(x, 0.0, 0.4)) for x in (0.40, 0.60))
    lid = box("lid", (0.22, 2.0, 0.02), at(0.5, 0.0, 0.6))
    station, task = scene(line(), obstacles=(*walls, lid), path_end_s=8.0)
    folded = np.array([0.0, -1.57, 2.6, -2.6, -1.57, 0.0])
    station.arm._follower = Follower(station.arm.limits, folded, lambda: station.world.now_s)
    result = DynamicGrasper().run(station, task)
    assert result.outcome in (GraspOutcome.NO_GRASP, GraspOutcome.NO_WAY, GraspOutcome.UNREACHABLE)
    assert station.world.now_s < 8.0


@pytest.mark.parametrize(
    "cfg",
    [
        GrasperCfg(predictor="constant_velocity"),
        GrasperCfg(ranking="both"),
        GrasperCfg(seeding=False),
        GrasperCfg(switching=False),
        GrasperCfg(limits="thesis"),
    ],
    ids=["predictor", "ranking", "seeding", "switching", "limits"],
)
def test_every_part_can_be_switched(cfg: GrasperCfg) -> None:
    result, _ = run(line(), cfg)
    assert result.outcome is GraspOutcome.LIFTED
    assert result.committed_s is not None
    assert cfg.limits == "rated" or result.committed_s > 2.0


def test_algorithm_1_grasps_too_but_later() -> None:
    ours, _ = run(line((0.5, -0.5)), GrasperCfg(limits="thesis"))
    theirs, _ = run(line((0.5, -0.5)), GrasperCfg.thesis())
    assert theirs.outcome is GraspOutcome.LIFTED
    assert ours.committed_s is not None
    assert theirs.committed_s is not None
    assert ours.committed_s < theirs.committed_s
    assert ours.loops > theirs.loops


def test_a_slow_arm_may_go_forward_from_within_a_tenth_of_a_radian_of_the_pre_grasp() -> None:
    """At 0.1 rad/s² the last 0.1 rad take 1.4 s, at the rated limits almost nothing."""
    slow, _ = run(line(), GrasperCfg(limits="thesis", approach_limits="thesis"))
    quick, _ = run(line(), GrasperCfg(limits="thesis"))
    assert slow.outcome is quick.outcome is GraspOutcome.LIFTED
    assert slow.committed_s is not None
    assert quick.committed_s is not None
    assert slow.committed_s > quick.committed_s + 1.0


def test_ways_to_grasps_that_are_free_are_looked_for_longer_than_grasps() -> None:
    station, task = scene(line(), path_end_s=8.0)
    method = Run(station, task, GrasperCfg())
    station.world.wait(0.5)
    method.target.look(station.world)
    forecast = method.target.forecast(station.world.now_s, 20.0)
    method.scene.expect(forecast)

    def ending(free_n: int, since_s: float):
        return hopeless(method, Found(9, 5, free_n), forecast, station.world.now_s, since_s, 10.0)

    assert ending(free_n=3, since_s=5.0) is None
    assert ending(free_n=3, since_s=11.0) == (GraspOutcome.NO_WAY, "every way to a grasp is blocked")
    assert ending(free_n=0, since_s=5.0)[0] is GraspOutcome.NO_GRASP


def test_settings_without_meaning_are_refused() -> None:
    with pytest.raises(ConfigError, match="back_off_m must be positive"):
        GrasperCfg(back_off_m=0.0)
    with pytest.raises(ConfigError, match="switch_gain"):
        GrasperCfg(switch_gain=1.0)


def test_a_ranking_by_motion_needs_who_judges_it() -> None:
    with pytest.raises(GraspError, match="needs a motion-aware scorer"):
        DynamicGrasper(GrasperCfg(ranking="motion"))
