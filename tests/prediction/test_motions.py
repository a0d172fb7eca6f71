"""Target motions: exact, as fast as asked, drawn from the ranges of the benchmark."""

from __future__ import annotations

import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from tr_grasp.errors import PredictionError
from tr_grasp.prediction.motions import (
    MOTIONS,
    Motion,
    MotionCfg,
    TargetState,
    bezier,
    circular,
    linear,
    random_turns,
    rotating,
    sample_motion,
    sinusoidal,
    varying_speed,
)

CONSTANT = ["linear", "circular", "linear_z", "rotating", "bezier", "random_turns"]
"""Kinds whose speed in space is the one asked for, always."""


def sample(kind: str, n: int = 4, speed_m_s: float = 0.03, seed: int = 0, cfg: MotionCfg | None = None) -> Motion:
    return sample_motion(kind, n, speed_m_s=speed_m_s, generator=torch.Generator().manual_seed(seed), cfg=cfg)


def inside(motion: Motion, times_n: int = 50) -> torch.Tensor:
    share = torch.linspace(0.003, 0.997, times_n, dtype=torch.float64).unsqueeze(-1)
    return share * motion.duration_s


@given(kind=st.sampled_from(sorted(MOTIONS)), seed=st.integers(0, 1000), speed=st.floats(0.005, 0.2))
@settings(max_examples=40)
def test_the_velocity_is_the_slope_of_the_position(kind: str, seed: int, speed: float) -> None:
    motion = sample(kind, 3, speed, seed)
    times, step = inside(motion, 20), 1e-4
    slope = (motion.at(times + step).position - motion.at(times - step).position) / (2 * step)
    # A jump of speed within a step, as varying_speed has nine, is no slope.
    close = (slope - motion.at(times).velocity).norm(dim=-1) < 1e-6 * max(1.0, speed / 0.03)
    assert close.double().mean() > (0.9 if kind == "varying_speed" else 0.999)


@given(kind=st.sampled_from(CONSTANT), seed=st.integers(0, 1000), speed=st.floats(0.005, 0.2))
@settings(max_examples=30)
def test_a_target_is_as_fast_as_asked(kind: str, seed: int, speed: float) -> None:
    motion = sample(kind, 3, speed, seed)
    assert torch.allclose(motion.at(inside(motion)).velocity.norm(dim=-1), torch.tensor(speed).double(), rtol=1e-7)


@pytest.mark.parametrize("kind", CONSTANT)
def test_the_way_made_is_speed_times_time(kind: str) -> None:
    motion = sample(kind, 3)
    times = torch.linspace(0, 1, 4001, dtype=torch.float64).unsqueeze(-1) * motion.duration_s
    steps = motion.at(times).position.diff(dim=0).norm(dim=-1)
    assert torch.allclose(steps.sum(0), 0.03 * motion.duration_s, rtol=1e-5)
    assert torch.allclose(steps, steps.mean(0), rtol=1e-3)


@pytest.mark.parametrize("kind", sorted(MOTIONS))
def test_gradients_by_time_are_the_velocity(kind: str) -> None:
    motion = sample(kind, 2)
    times = inside(motion, 7).requires_grad_()
    state = motion.at(times)
    for axis in range(3):
        (slope,) = torch.autograd.grad(state.position[..., axis].sum(), times, retain_graph=True)
        assert torch.allclose(slope, state.velocity[..., axis], atol=1e-9)


@pytest.mark.parametrize("kind", sorted(MOTIONS))
def test_a_target_waits_at_the_start_and_stands_at_the_end(kind: str) -> None:
    motion = sample(kind)
    before, start, end, after = (motion.at(t) for t in (-3.0, 0.0, motion.duration_s, motion.duration_s + 9.0))
    assert torch.equal(before.position, start.position)
    assert torch.equal(end.position, after.position)
    assert not before.velocity.any()
    assert not after.velocity.any()
    assert start.velocity.norm(dim=-1).min() > 0
    assert torch.equal(after.remaining_s, torch.zeros(4).double())


@pytest.mark.parametrize("kind", sorted(MOTIONS))
def test_a_batch_is_its_members(kind: str) -> None:
    motion = sample(kind)
    times = torch.tensor([[0.0], [4.0], [11.3]], dtype=torch.float64)
    together = motion.at(times)
    for index in range(4):
        alone = motion[index].at(times)
        for ours, theirs in zip(together, alone, strict=True):
            assert torch.allclose(ours[:, index], theirs[:, 0], atol=1e-12)


@pytest.mark.parametrize("kind", sorted(MOTIONS))
def test_a_seed_decides_everything(kind: str) -> None:
    first, second, other = sample(kind, seed=3), sample(kind, seed=3), sample(kind, seed=4)
    assert all(torch.equal(first.parameters[name], second.parameters[name]) for name in first.parameters)
    assert any(not torch.equal(first.parameters[name], other.parameters[name]) for name in first.parameters)


@pytest.mark.parametrize("kind", ["bezier", "random_turns"])
def test_free_paths_stay_in_reach(kind: str) -> None:
    motion = sample(kind, 20)
    reach = motion.at(inside(motion, 200)).position[..., :2].norm(dim=-1)
    assert reach.min() > 0.25 - 5e-3
    assert reach.max() < 0.85 + 5e-3


def test_the_ranges_are_those_of_the_benchmark() -> None:
    many = sample("linear", 2000)
    distance, theta = many.parameters["distance_m"], many.parameters["theta_rad"]
    assert 0.3 <= distance.min() < 0.31 and 0.69 < distance.max() <= 0.7  # noqa: PT018
    assert -math.pi / 2 <= theta.min() < -1.55 and 1.55 < theta.max() <= math.pi / 2  # noqa: PT018
    assert 0.45 < (many.parameters["direction"] > 0).double().mean() < 0.55
    heights = sample("linear_z", 500).parameters
    assert heights["z_start_m"].min() >= 0.01 and heights["z_end_m"].max() <= 0.30  # noqa: PT018


def test_amplitudes_can_be_a_share_of_the_distance() -> None:
    parameters = sample("sinusoidal", 5, cfg=MotionCfg(amplitude_share=0.5)).parameters
    assert torch.equal(parameters["amplitude_m"], parameters["distance_m"] / 2)


def placed(state: TargetState) -> list[float]:
    return [round(float(x), 9) for x in state.position]


def test_a_line_at_angle_0_goes_to_the_left() -> None:
    line = {"speed_m_s": 0.1, "distance_m": 0.5, "theta_rad": 0.0}
    assert placed(linear(0.0, **line)) == [0.5, -0.5, 0.02]
    assert placed(linear(5.0, **line)) == [0.5, 0.0, 0.02]
    assert placed(linear(2.5, **line, direction=-1.0)) == [0.5, 0.25, 0.02]
    assert float(linear(0.0, **line).remaining_s) == pytest.approx(10.0)


def test_a_line_at_a_quarter_turn_lies_across_y() -> None:
    assert placed(linear(0.0, speed_m_s=0.1, distance_m=0.5, theta_rad=math.pi / 2)) == [0.5, 0.5, 0.02]


def test_a_quarter_of_a_circle_goes_from_x_to_y() -> None:
    radius, speed = 0.4, 0.1
    quarter_s = radius * math.pi / 2 / speed
    state = circular(quarter_s, speed_m_s=speed, distance_m=radius, theta_rad=0.0)
    assert placed(state) == [0.0, 0.4, 0.02]
    assert [round(float(v), 9) for v in state.velocity] == [-0.1, 0.0, 0.0]


def test_the_sine_of_the_benchmark_has_three_periods_and_peaks_at_2_56_times_the_speed() -> None:
    sine = {"speed_m_s": 0.03, "distance_m": 0.5, "theta_rad": 0.0}
    times = torch.linspace(0.001, 33.3, 5000, dtype=torch.float64)
    states = sinusoidal(times, **sine)
    assert states.velocity.norm(dim=-1).max() == pytest.approx(0.0768, rel=1e-3)
    assert states.position[:, 0].max() == pytest.approx(0.625, abs=1e-6)
    above = states.position[:, 0] > 0.5
    assert int((above[1:] != above[:-1]).sum()) in (5, 6)


def test_varying_speed_falls_evenly_to_60_percent() -> None:
    slowing = {"speed_m_s": 0.1, "distance_m": 0.5, "theta_rad": 0.0}
    assert float(varying_speed(0.5, **slowing).velocity[1]) == pytest.approx(0.1)
    # 0.1 m at 0.1 m/s takes 1 s; the second segment is 0.4 / 9 slower.
    assert float(varying_speed(1.5, **slowing).velocity[1]) == pytest.approx(0.1 * (1 - 0.4 / 9))
    end_s = float(varying_speed(0.0, **slowing).remaining_s)
    assert float(varying_speed(end_s - 0.1, **slowing).velocity[1]) == pytest.approx(0.06)
    assert placed(varying_speed(end_s, **slowing)) == [0.5, 0.5, 0.02]


def test_a_rotating_target_turns_at_its_rate_until_it_stops() -> None:
    turning = {"speed_m_s": 0.1, "distance_m": 0.5, "theta_rad": 0.0, "yaw_rate_rad_s": -0.4, "yaw_rad": 1.0}
    assert float(rotating(5.0, **turning).yaw) == pytest.approx(-1.0)
    assert float(rotating(5.0, **turning).yaw_rate) == pytest.approx(-0.4)
    assert float(rotating(99.0, **turning).yaw) == pytest.approx(-3.0)
    assert float(rotating(99.0, **turning).yaw_rate) == 0.0


def test_a_straight_bezier_is_a_line() -> None:
    points = torch.tensor([[0.0, 0, 0], [0.1, 0, 0], [0.7, 0, 0], [1.0, 0, 0]])
    assert placed(bezier(2.5, speed_m_s=0.1, control_points_m=points)) == [0.25, 0.0, 0.0]


def test_straight_on_then_a_quarter_turn_left() -> None:
    path = {
        "start_m": torch.zeros(3),
        "heading_rad": 0.0,
        "lengths_m": torch.tensor([0.2, 0.1 * math.pi / 2]).double(),
        "curvatures_1_m": torch.tensor([0.0, 10.0]),
    }
    assert placed(random_turns(2.0, speed_m_s=0.1, **path)) == [0.2, 0.0, 0.0]
    end = random_turns(99.0, speed_m_s=0.1, **path)
    assert [round(float(x), 6) for x in end.position] == [0.3, 0.1, 0.0]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"kind": "linaer"}, "unknown motion 'linaer'; did you mean 'linear'?"),
        ({"speed": 0.0}, "speed_m_s must be positive"),
        ({"speed": math.nan}, "speed_m_s must be positive"),
        ({"kind": "bezier", "cfg": MotionCfg(annulus_m=(0.5, 0.51))}, "no path of kind 'bezier' fits"),
    ],
)
def test_a_motion_that_cannot_be_is_refused(change: dict, sentence: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tr_grasp.prediction.motions.sampling._MOST_TRIES", 5)
    with pytest.raises(PredictionError, match=sentence.replace("?", r"\?")):
        sample(change.get("kind", "linear"), 2, change.get("speed", 0.03), cfg=change.get("cfg"))
