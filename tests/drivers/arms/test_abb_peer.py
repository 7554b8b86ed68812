"""The simulated IRC5 against the client that we did not write: abb-robot-client."""

import time
from contextlib import contextmanager

import pytest
from abb_robot_client.rws import RWS, ABBException
from benches import ABB_HOME, abb_peer, slowly, until, wait_steady

from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings


@contextmanager
def client():
    with abb_peer() as (controller, _):
        rws = RWS(controller.url)  # with the defaults of the package
        yield rws, controller
        rws.close()


def test_the_speed_ratio_is_reported_and_set_and_slows_the_arm():
    with client() as (rws, controller):
        assert rws.get_speedratio() == 100.0
        rws.set_speedratio(25.0)
        assert rws.get_speedratio() == 25.0
        arm = ABBArm(controller.url, ABBSettings(login=FACTORY_LOGIN))
        arm.connect()
        begin_s = time.monotonic()
        arm.start_move(slowly(tuple(angle + 0.1 for angle in ABB_HOME)))
        assert wait_steady(arm, 20.0).fault is None
        assert time.monotonic() - begin_s > 1.5  # 0.1 rad at a quarter of 0.2 rad/s
        arm.close()


def test_signals_are_reported_and_set_by_network_unit_and_name():
    with client() as (rws, controller):
        controller.signals |= {"Local/DRV_1/do_lamp": 0.0, "Local/DRV_1/ao_light": 0.0}
        rws.set_digital_io("do_lamp", True)
        rws.set_analog_io("ao_light", 2.5)
        assert rws.get_digital_io("do_lamp") == 1
        assert rws.get_analog_io("ao_light") == 2.5
        with pytest.raises(ABBException):
            rws.get_digital_io("nowhere")


def test_persistent_data_are_found_read_and_written():
    with client() as (rws, controller):
        controller.rapid_data["T_ROB1/cell/steps"] = "7"
        rws.set_rapid_variable_num("cell/steps", 8)
        assert rws.get_rapid_variable_num("cell/steps") == 8.0
        assert [found["name"] for found in rws.get_rapid_variables()] == ["steps"]
        found = {one["name"] for one in rws.get_rapid_variables("T_CELL_WATCH")}
        assert "cell_watch_beat" in found
        with pytest.raises(ABBException):
            rws.get_rapid_variable("cell/nothing")


def test_mastership_is_held_by_one_client_at_a_time():
    with client() as (rws, controller):
        rws._do_post("rw/mastership/motion?action=request")
        other = RWS(controller.url)
        with pytest.raises(ABBException, match="held"):
            other._do_post("rw/mastership?action=request")
        [reported] = rws._do_get("rw/mastership/motion")["_embedded"]["_state"]
        assert reported["mastership"] == "remote"
        rws._do_post("rw/mastership/motion?action=release")
        other._do_post("rw/mastership?action=request")


def test_remote_mastering_is_granted_in_automatic_mode():
    with client() as (rws, _):
        rws._do_post("users/rmmp?json=1", {"privilege": "modify"})
        [reported] = rws._do_get("users/rmmp/poll")["_embedded"]["_state"]
        assert reported["status"] == "GRANTED"


def test_the_ram_disk_has_files_under_either_of_its_names():
    with client() as (rws, _):
        disk = rws.get_ramdisk_path()
        rws.upload_file("$RAMDISK/hello.bin", b"\x01\x02")
        assert rws.read_file(f"{disk}/hello.bin") == b"\x01\x02"
        assert rws.list_files(disk) == ["hello.bin"]
        rws.delete_file(f"{disk}/hello.bin")
        assert rws.list_files("$RAMDISK") == []


def test_logging_out_is_answered():
    with client() as (rws, controller):
        before = len(controller.request_times_s)
        rws.logout()
        assert until(lambda: len(controller.request_times_s) > before)
