"""The real clock, on a pretended one: sleeping too long, too short, and not drifting."""

import threading

import numpy as np
import pytest

from tr_grasp.errors import MotionError
from tr_grasp.hardware import PoseReading
from tr_grasp.hardware.adapters.remote_clock import RemoteClock
from tr_grasp.hardware.real_world import RealWorld


class Pretended:
    """A clock whose sleeps take a little longer than asked."""

    def __init__(self, late_s=0.0):
        self.now, self.late_s, self.slept = 100.0, late_s, []

    def __call__(self):
        return self.now

    def sleep(self, duration_s):
        self.slept.append(duration_s)
        self.now += duration_s + self.late_s


def world(late_s=0.0, tracked=()):
    clock = Pretended(late_s)
    return RealWorld(tracked, clock, clock.sleep), clock


def test_many_waits_that_oversleep_are_as_long_as_one():
    made, _ = world(late_s=0.0003)
    for _ in range(100):
        made.wait(0.001)
    assert made.now_s == pytest.approx(0.1 + 0.0003, abs=1e-9)


def test_what_the_caller_computes_between_two_waits_is_not_taken_off():
    made, clock = world()
    made.wait(0.1)
    clock.now += 2.0
    made.wait(0.5)
    assert made.now_s == pytest.approx(2.6)


def test_thinking_has_been_paid_for_already():
    made, clock = world()
    made.charge(5.0)
    assert made.now_s == 0.0
    assert clock.slept == []
    for call in (made.wait, made.charge):
        with pytest.raises(MotionError, match="duration_s"):
            call(-1.0)


def beats_of(period_s, late_s=0.0, work_s=0.0, until=20):
    """Times of the first beats of a thread on a pretended clock."""
    made, clock = world(late_s)
    times, done = [], threading.Event()

    def beat():
        times.append(made.now_s)
        clock.now += work_s
        if len(times) >= until:
            done.set()
            end()

    started = threading.Event()
    held = []

    def first():
        started.wait(5)
        beat()

    held.append(made.every(period_s, first))

    def end():
        held[0]()

    started.set()
    assert done.wait(5)
    return np.array(times)


def test_beats_do_not_drift_however_long_sleeps_and_work_take():
    times = beats_of(0.01, late_s=0.0004, work_s=0.003)
    np.testing.assert_allclose(times[1:] - 0.01 * np.arange(1, len(times)), 0.0004, atol=1e-9)


def test_beats_that_are_missed_are_left_out_and_never_made_up_for_in_a_burst():
    times = beats_of(0.01, work_s=0.025)
    np.testing.assert_allclose(np.diff(times), 0.03, atol=0.0051)
    assert np.diff(times).min() > 0.01


def test_reports_are_kept_and_the_unknown_is_named():
    made, _ = world(tracked=["can"])
    for stamp in (0.1, 0.2):
        made.report("can", PoseReading(stamp, np.eye(4)))
    assert [reading.stamp_s for reading in made.poses("can", after_s=0.1)] == [0.2]
    with pytest.raises(MotionError, match="unknown object 'cup'"):
        made.poses("cup")


def test_closing_lets_go_of_the_last_device_first_and_only_once():
    made, _ = world()
    gone = []
    for name in ("camera", "gripper", "arm"):
        made.at_close(lambda name=name: gone.append(name))
    with made:
        pass
    made.close()
    assert gone == ["arm", "gripper", "camera"]


def test_stamps_of_another_clock_are_late_by_the_fastest_way_and_never_in_the_future():
    remote, rng = RemoteClock(), np.random.default_rng(0)
    ways = 0.002 + 0.02 * rng.random(200)
    sent = 0.01 * np.arange(200)
    local = np.array([remote.local_s(5000.0 + t, t + way) for t, way in zip(sent, ways, strict=True)])
    late = local - sent
    assert (local <= sent + ways).all()
    assert late[50:].max() < 0.002 + 0.002
    assert late.min() >= 0.002 - 1e-9


def test_a_clock_that_runs_slower_is_followed():
    remote = RemoteClock()
    late = [remote.local_s(t * (1 - 5e-5), t) - t for t in np.arange(0, 1000, 1.0)]
    assert max(np.abs(late)) < 1e-3
