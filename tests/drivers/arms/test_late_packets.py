"""Packets that come late, as a busy computer hands them over, are taken for what they are."""

from __future__ import annotations

import time
from collections import deque

import pytest
from benches import UR_HOME, quickly, ur_peer, wait_steady

from drivers.arm import Motion
from drivers.ur import URArm, URSettings, reader
from drivers.ur.sample_times import SampleTimes
from drivers.ur.wire import Frame, receive

LAG_S = 0.6


def test_a_packet_that_waited_is_older_than_its_arrival() -> None:
    times = SampleTimes()
    assert times.host_t_s(100.010, 7.0) == pytest.approx(100.010)
    assert times.host_t_s(100.012, 7.008) == pytest.approx(100.012)
    assert times.host_t_s(100.512, 7.016) == pytest.approx(100.020)
    assert times.host_t_s(100.513, 7.504) == pytest.approx(100.508)


def test_clocks_that_drift_apart_are_followed() -> None:
    times = SampleTimes()
    for second in range(1000):
        controller_s = second * (1.0 - 1e-4)
        sampled_s = times.host_t_s(float(second), controller_s)
    assert sampled_s == pytest.approx(999.0, abs=2e-3)


def test_late_packets_are_not_taken_for_the_end_of_a_motion_that_had_not_begun(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    waiting: deque[tuple[float, tuple[int, bytes]]] = deque()
    lag_s = [0.0]

    def late(link, deadline_s):  # type: ignore[no-untyped-def]
        while not waiting or time.monotonic() - waiting[0][0] < lag_s[0]:
            frame = receive(link, deadline_s)
            if frame[0] != Frame.DATA_PACKAGE:
                return frame
            waiting.append((time.monotonic(), frame))
        return waiting.popleft()[1]

    monkeypatch.setattr(reader, "receive", late)
    with ur_peer() as (controller, sim):
        patient = URSettings(silence_s=3.0, watchdog_hz=0.5, start_timeout_s=30.0)
        arm = URArm(controller.address, patient)
        try:
            arm.connect()
            lag_s[0] = LAG_S
            time.sleep(2 * LAG_S)
            near = tuple(angle + 0.03 for angle in UR_HOME)
            arm.start_move(quickly(near))
            state = wait_steady(arm, 20.0)
            assert state.motion is Motion.STEADY, state.fault
            assert state.joints_rad == pytest.approx(near, abs=1e-4)
            assert sim.truth().joints_rad == pytest.approx(near, abs=1e-4)
        finally:
            arm.close()
