"""What an IRC5, its library and the network can do to a run, and that the arm stops."""

import random
import re
import signal
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from benches import (
    ABB_HOME,
    PATIENT_ABB,
    abb_peer,
    free_udp_port,
    halts_short_of,
    quickly,
    slowly,
    stays,
    truly_moving,
    unreachable,
    until,
    wait_steady,
)
from hazards import halts_within, process_moving
from scipy.spatial.transform import RigidTransform, Rotation

from calib.chain.kinematics import arm as kinematics_of
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings, Login, link_watch
from drivers.abb.program import build_program
from drivers.abb.readings import Reading
from drivers.abb.status import fault_in
from drivers.arm import Motion, MoveTarget
from drivers.errors import ArmStopped, DeviceError, DeviceRefused, DeviceUnreachable, StopFailed
from sim.peers.abb.motion_program import decode

GOAL_S = 0.1
LOGGED_IN = ABBSettings(login=FACTORY_LOGIN)
LINK_WATCH_S = ABBSettings().link_watch_s
FAR = tuple(angle + 0.6 for angle in ABB_HOME)
MOUNTED = RigidTransform.from_components([0.5, -0.2, 1.0], Rotation.from_rotvec([0, 0.3, 1.2]))


@contextmanager
def connected(egm=False, **settings):
    port = free_udp_port() if egm else None
    with abb_peer(port) as (controller, sim):
        controller.world_from_base = MOUNTED
        controller.flange_from_active_tool = RigidTransform.from_translation([0, 0, 0.2])
        arm = ABBArm(controller.url, ABBSettings(login=FACTORY_LOGIN, egm_port=port, **settings))
        try:
            arm.connect()
            yield arm, controller, sim
        finally:
            arm.close()


@contextmanager
def moving(egm=False, **settings):
    with connected(egm, **settings) as (arm, controller, sim):
        arm.start_move(slowly(FAR))
        assert until(lambda: truly_moving(sim))
        time.sleep(0.1)
        yield arm, controller, sim


def test_a_stop_reaches_the_arm_within_100_ms_after_the_connections_were_dropped():
    def stop(arm, controller):
        controller.drop()
        arm.stop()

    halts_within(GOAL_S, moving, stop, FAR)


def test_dropped_connections_are_made_again_and_the_move_ends_at_its_target():
    with moving(**PATIENT_ABB) as (arm, controller, _):
        controller.drop()
        state = wait_steady(arm)
        assert state.fault is None
        assert state.joints_rad == pytest.approx(FAR, abs=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_a_stop_at_any_instant_of_a_start_leaves_the_arm_standing(seed):
    with connected() as (arm, _, sim):
        arm.start_move(slowly(FAR))
        time.sleep(random.Random(seed).uniform(0.0, 0.08))
        arm.stop()
        wait_steady(arm)
        assert not truly_moving(sim)
        assert stays(sim)


_CONNECT = """
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings
arm = ABBArm(sys.argv[1], ABBSettings(login=FACTORY_LOGIN))
"""


@contextmanager
def elsewhere():
    """A process of its own moves the arm."""
    with (
        abb_peer() as (controller, sim),
        process_moving(_CONNECT, controller.url, sim, FAR) as process,
    ):
        yield process, controller, sim


def test_the_arm_stops_when_our_process_is_killed_on_the_way():
    halts_within(GOAL_S, elsewhere, lambda process, _: process.kill(), FAR)


def test_a_key_turned_between_two_questions_is_reported_as_such():
    class Panel:
        mode, state = "AUTO", "motoron"

        def turns(self, answer):
            self.mode, self.state = "MANR", "guardstop"
            return answer

        def get_operation_mode(self):
            return self.turns(self.mode)

        def get_controller_state(self):
            return self.turns(self.state)

    assert "turn the key to automatic" in fault_in(Panel())


def test_a_controller_that_falls_silent_holds_nobody_up_and_is_reported():
    with moving() as (arm, controller, _):
        controller.cut()
        begin_s = time.monotonic()
        arm.stop()
        assert time.monotonic() - begin_s < 0.1
        durations_s = []

        def failing():
            call_s = time.monotonic()
            try:
                arm.state()
            except (DeviceUnreachable, StopFailed):
                return True
            finally:
                durations_s.append(time.monotonic() - call_s)
            return False

        assert until(failing)
        assert np.median(durations_s) < 0.05
        controller.faults.mend_cable()


def test_a_dead_controller_fails_the_stop_loudly_and_at_once():
    with moving() as (arm, controller, _):
        controller.kill()
        durations_s = []

        def fails():
            begin_s = time.monotonic()
            try:
                arm.stop()
            except StopFailed as failed:
                return "emergency stop" in str(failed)
            finally:
                durations_s.append(time.monotonic() - begin_s)
            return False

        # on a busy machine the refusal may come after `stop` has returned
        assert until(fails)
        assert np.median(durations_s) < 0.1
        assert until(lambda: unreachable(arm))


def test_a_cut_cable_stops_the_motion_under_way():
    halts_within(
        LINK_WATCH_S + GOAL_S,
        moving,
        lambda _, controller: controller.cut(),
        FAR,
        then=lambda _, controller: controller.faults.mend_cable(),
    )


def test_a_cut_cable_that_nobody_watches_stops_nothing():
    # the hazard itself, so that the test above means something
    with moving(link_watch_s=None) as (_, controller, sim):
        controller.cut()
        assert not until(lambda: not truly_moving(sim), 2 * LINK_WATCH_S)
        controller.faults.mend_cable()


def test_the_arm_stops_when_our_process_hangs_on_the_way():
    halts_within(
        LINK_WATCH_S + GOAL_S,
        elsewhere,
        lambda process, _: process.send_signal(signal.SIGSTOP),
        FAR,
    )


def test_a_motion_that_the_controller_stopped_for_silence_is_reported_as_such():
    with moving() as (arm, controller, _):
        controller.cut()
        assert until(lambda: controller.watch.values["stops"] == 1)
        controller.faults.mend_cable()
        assert until(lambda: arm.state().motion is Motion.STOPPED_BY_FAULT)
        assert "heard nothing" in arm.state().fault
        assert "check the cable" in arm.state().fault


@pytest.mark.parametrize(("part", "words"), [("loaded", "cell_watch.mod"), ("running", "start it")])
def test_nothing_moves_where_the_controller_does_not_watch_the_link(part, words):
    with abb_peer() as (controller, _):
        setattr(controller.watch, part, False)
        with pytest.raises(DeviceRefused, match=words):
            ABBArm(controller.url, LOGGED_IN).connect()
        ABBArm(controller.url, ABBSettings(login=FACTORY_LOGIN, link_watch_s=None)).connect()


def test_nobody_is_watched_while_the_arm_stands():
    with connected() as (arm, controller, _):
        arm.start_move(quickly(tuple(angle + 0.05 for angle in ABB_HOME)))
        wait_steady(arm)
        assert until(lambda: controller.watch.values["beat"] == 0)
        controller.cut()
        time.sleep(1.5 * LINK_WATCH_S)
        assert controller.watch.values["stops"] == 0
        controller.faults.mend_cable()


def test_a_refused_stop_switches_the_motors_off():
    with moving(**PATIENT_ABB) as (arm, controller, sim):
        controller.faults.rapid_stop_refused = True
        arm.stop()
        assert halts_short_of(sim, FAR)
        assert controller.panel.controller == "motoroff"


def test_a_wrong_password_is_reported_as_such():
    with (
        abb_peer() as (controller, _),
        pytest.raises(DeviceRefused, match="password"),
    ):
        ABBArm(controller.url, ABBSettings(login=Login("Default User", "guess"))).connect()


@pytest.mark.parametrize(
    ("order", "words"),
    [
        (lambda controller: controller.to_manual(), "automatic"),
        (lambda controller: controller.guard_stop(), "guard"),
        (lambda controller: controller.emergency_stop(), "release the button"),
    ],
    ids=["manual", "guard", "emergency"],
)
def test_what_keeps_the_arm_from_moving_is_reported_before_and_on_the_way(order, words):
    with moving(**PATIENT_ABB) as (arm, controller, sim):
        order(controller)
        assert until(lambda: arm.state().motion is Motion.STOPPED_BY_FAULT)
        assert words in arm.state().fault
        assert stays(sim)
        with pytest.raises(ArmStopped, match=words):
            arm.connect()


def test_a_running_rapid_program_is_not_disturbed():
    with abb_peer() as (controller, _):
        controller.running = True
        with pytest.raises(DeviceRefused, match="RAPID program is running"):
            ABBArm(controller.url, LOGGED_IN).connect()


def test_a_move_that_rapid_cannot_make_is_a_fault_with_its_words():
    with connected() as (arm, _, sim):
        far = RigidTransform.from_translation([5.0, 0.0, 0.0])
        arm.start_move(MoveTarget(base_from_flange=far))
        assert until(lambda: arm.state().motion is Motion.STOPPED_BY_FAULT)
        assert "flange" in arm.state().fault
        assert not truly_moving(sim)


def test_nobody_there_is_reported_as_such():
    with pytest.raises(DeviceUnreachable, match="OmniCore"):
        ABBArm("http://127.255.255.254:8610", LOGGED_IN).connect()


def test_the_controller_is_asked_fewer_than_twenty_times_a_second():
    with moving() as (_, controller, _):
        begin_s = time.monotonic()
        time.sleep(1.5)
        asked = [t for t in controller.request_times_s if t > begin_s]
        assert 5 < len(asked) / 1.5 < 20


def test_a_pose_is_of_the_flange_in_the_base_wherever_the_arm_is_mounted():
    with connected(**PATIENT_ABB) as (arm, _, sim):
        state = arm.state()
        off = state.base_from_flange.inv() * sim.state().base_from_flange
        assert np.linalg.norm(off.translation) < 1e-6
        goal = RigidTransform.from_translation([0.02, 0.01, -0.03]) * state.base_from_flange
        arm.start_move(MoveTarget(base_from_flange=goal))
        assert wait_steady(arm).fault is None
        off = sim.state().base_from_flange.inv() * goal
        assert np.linalg.norm(off.translation) < 1e-6


def test_egm_reports_joints_and_flange_pose_of_one_instant_on_the_way():
    forward = kinematics_of("irb140").forward
    with moving(egm=True, **PATIENT_ABB) as (arm, _, _):
        clocks = set()
        for _ in range(30):
            state = arm.state()
            assert state.raw["source"] == "egm"
            expected = RigidTransform.from_matrix(forward(np.array(state.joints_rad)))
            off = state.base_from_flange.inv() * expected
            # the mounting comes from RWS, which prints quaternions to nine digits
            assert np.linalg.norm(off.translation) < 1e-7
            clocks.add(state.controller_t_s)
            time.sleep(0.01)
        assert len(clocks) > 15


def test_an_egm_port_in_use_is_reported_as_such():
    with connected(egm=True) as (arm, controller, _):
        settings = ABBSettings(login=FACTORY_LOGIN, egm_port=arm._settings.egm_port)
        with pytest.raises(DeviceRefused, match="UDP port"):
            ABBArm(controller.url, settings).connect()


def test_a_program_says_what_was_asked_for_to_single_precision():
    pose = RigidTransform.from_components([0.4, -0.1, 0.5], Rotation.from_rotvec([1, 2, 0.3]))
    reading = Reading(0.0, None, ABB_HOME, pose, (9e9,) * 6, (0.0,) * 4, {})
    asked = MoveTarget(joints_rad=FAR, tcp_speed_m_s=0.2, joint_speed_rad_s=0.3)
    [read] = decode(build_program(asked, reading, MOUNTED).get_program_bytes())
    assert read.joints_rad == pytest.approx(FAR, abs=1e-7)
    assert read.tcp_speed_m_s == pytest.approx(0.2)
    assert read.joint_speed_rad_s == pytest.approx(0.3)
    asked = MoveTarget(base_from_flange=pose)
    [read] = decode(build_program(asked, reading, MOUNTED).get_program_bytes())
    off = read.base_from_flange.inv() * (MOUNTED * pose)
    assert np.linalg.norm(off.translation) < 1e-7
    assert off.rotation.magnitude() < 1e-6


def test_moving_again_after_a_guard_stop_needs_a_new_connection():
    with moving(**PATIENT_ABB) as (arm, controller, _):
        controller.guard_stop()
        assert until(lambda: arm.state().fault is not None)
        controller.panel.controller = "motoron"
        with pytest.raises(DeviceError):
            arm.start_move(quickly(ABB_HOME))
        arm.connect()
        arm.start_move(quickly(ABB_HOME))
        assert wait_steady(arm).joints_rad == pytest.approx(ABB_HOME, abs=1e-5)


def test_the_module_for_the_controller_has_what_the_driver_and_the_peer_speak_of():
    folder = Path(link_watch.__file__).parent / "rapid"
    module = (folder / "cell_watch.mod").read_text()
    configuration = (folder / "cell_watch.cfg").read_text()
    with abb_peer() as (controller, _):
        names = {f"{link_watch.MODULE}_{name}" for name in controller.watch.values}
        limit = controller.watch.values["limit"]
    assert set(re.findall(r"PERS num (\w+)", module)) == names
    assert f"MODULE {link_watch.MODULE}\n" in module
    assert f"cell_watch_limit := {limit:g};" in module
    assert f'-Name "{link_watch.TASK}"' in configuration
    entry = re.search(r"PROC (\w+)", module)[1]
    assert f'-Entry "{entry}"' in configuration
