"""How the ABB driver logs in, to whom, and that nobody reads the password anywhere."""

import json
import logging
import time
from contextlib import contextmanager

import pytest
from benches import ABB_HOME, simulated, slowly, until, wait_steady

from cell.devices.abb_settings import abb_settings
from cell.errors import InputError
from cell.storage.files.cell_file import AbbRobot
from drivers.abb import FACTORY_LOGIN, ABBArm, ABBSettings, Login
from drivers.abb.rws import open_rws
from drivers.abb.transport import LARGEST_ANSWER_BYTES, certificate_of, resolved
from drivers.errors import DeviceError, DeviceRefused
from drivers.outside import parse_json
from sim.peers.abb import ABBController
from sim.peers.abb.answers import Answer
from sim.peers.loopback import own_address

SECRET = "open-sesame-4711"


@contextmanager
def controller(**options):
    sim = simulated("irb140", ABB_HOME)
    with ABBController(sim, own_address(), **options) as peer:
        yield peer


def refusal(address, settings):
    arm = ABBArm(address, settings)
    with pytest.raises(DeviceRefused) as refused:
        arm.connect()
    return str(refused.value)


def trusting(peer):
    return ABBSettings(
        login=FACTORY_LOGIN, certificate_sha256=certificate_of(peer.address, peer.port)
    )


def test_https_is_spoken_where_the_controller_has_it_and_its_certificate_is_trusted():
    with controller(https=True) as peer:
        arm = ABBArm(f"{peer.address}:{peer.port}", trusting(peer))
        try:
            arm.connect()
            arm.start_move(slowly(tuple(angle + 0.05 for angle in ABB_HOME)))
            assert wait_steady(arm).fault is None
            arm.stop()
        finally:
            arm.close()


def test_a_certificate_that_nobody_compared_is_refused_with_its_fingerprint():
    with controller(https=True) as peer:
        output = refusal(f"{peer.address}:{peer.port}", ABBSettings(login=FACTORY_LOGIN))
        assert f"certificate_sha256: {certificate_of(peer.address, peer.port)}" in output
        assert not peer.request_times_s


def test_another_certificate_than_the_trusted_one_is_refused_and_gets_no_password():
    with controller(https=True) as peer:
        settings = ABBSettings(login=FACTORY_LOGIN, certificate_sha256="ab" * 32)
        assert "something else answers in its place" in refusal(
            f"{peer.address}:{peer.port}", settings
        )
        assert not peer.request_times_s


def test_a_trusted_controller_is_not_spoken_to_in_the_open():
    with controller() as peer:
        settings = ABBSettings(login=FACTORY_LOGIN, certificate_sha256="ab" * 32)
        assert "speaks no HTTPS" in refusal(f"{peer.address}:{peer.port}", settings)
        assert resolved(f"{peer.address}:{peer.port}", None) == peer.url


def test_a_fingerprint_may_have_colons_and_capitals():
    with controller(https=True) as peer:
        shown = certificate_of(peer.address, peer.port)
        written = ":".join(shown[i : i + 2] for i in range(0, 64, 2)).upper()
        assert resolved(f"{peer.address}:{peer.port}", written) == peer.url


def test_nothing_is_sent_without_a_login():
    with controller() as peer:
        assert "no user name and password" in refusal(peer.url, ABBSettings())
        assert not peer.request_times_s


def test_a_password_in_the_address_is_refused_and_not_repeated():
    output = refusal(f"http://admin:{SECRET}@10.0.0.1", ABBSettings(login=FACTORY_LOGIN))
    assert "no user name or password" in output
    assert SECRET not in output


def test_the_password_is_in_no_message_no_log_and_no_reading(caplog):
    caplog.set_level(logging.DEBUG)
    settings = ABBSettings(login=Login("Default User", SECRET), link_watch_s=None)
    assert SECRET not in repr(settings)
    with controller() as peer:
        assert "password is wrong" in refusal(peer.url, settings)
        assert SECRET not in refusal(peer.url, settings)
        arm = ABBArm(peer.url, ABBSettings(login=FACTORY_LOGIN))
        try:
            arm.connect()
            assert FACTORY_LOGIN.password not in json.dumps(arm.state().raw)
        finally:
            arm.close()
    assert SECRET not in caplog.text
    assert FACTORY_LOGIN.password not in caplog.text


def answering(peer, answer):
    """The peer gives this answer to every request that is logged in."""
    peer._http._server.RequestHandlerClass.resources.answer = lambda *_: answer


@pytest.mark.parametrize(
    "body",
    [b"[" * 100_000, b"\x00" * (LARGEST_ANSWER_BYTES + 1), b"{}", b"null", b"\xff\xfe"],
    ids=["deep", "huge", "empty", "null", "no text"],
)
def test_an_answer_that_cannot_be_is_an_error_with_a_name(body):
    with controller() as peer:
        answering(peer, Answer(200, body, "application/json"))
        arm = ABBArm(peer.url, ABBSettings(login=FACTORY_LOGIN))
        with pytest.raises(DeviceError) as refused:
            arm.connect()
        assert str(refused.value).isprintable()
        assert len(str(refused.value)) < 500


@pytest.mark.parametrize(
    "data", [b"[" * 10**6, b'{"a":' * 65 + b"1" + b"}" * 65, b'"\\' * 500_000 + b"[", b'"' * 10**6]
)
def test_json_that_no_device_nests_so_deep_is_refused_before_it_is_parsed(data):
    with pytest.raises(ValueError, match=r"nested|delimiter|Extra data|escape"):
        parse_json(data)


def test_brackets_in_words_nest_nothing():
    words = "[" * 100 + '"{'
    assert parse_json(json.dumps({"a": [words, {"b": []}]}).encode()) == {"a": [words, {"b": []}]}


def test_a_controller_that_points_elsewhere_is_not_followed():
    with controller() as peer, controller(port=8611) as elsewhere:
        moved = Answer(302, b"", headers=(("Location", f"{elsewhere.url}/rw/system"),))
        answering(peer, moved)
        with pytest.raises(DeviceError):
            ABBArm(peer.url, ABBSettings(login=FACTORY_LOGIN)).connect()
        assert not elsewhere.request_times_s


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("rax_2", "nan", "not finite"),
        ("rax_3", "170.0", "joint 3 stands at"),
        ("q1", "0.9", "length 1"),
        ("x", "inf", "not finite"),
    ],
)
def test_readings_that_cannot_be_are_refused_by_name(name, value, words):
    with controller() as peer:
        resources = peer._http._server.RequestHandlerClass.resources
        true_answer = resources.answer

        def answer(*asked):
            given = true_answer(*asked)
            if isinstance(given.body, dict):
                for entry in given.body.get("_embedded", {}).get("_state", []):
                    entry |= {name: value} if name in entry else {}
            return given

        arm = ABBArm(peer.url, ABBSettings(login=FACTORY_LOGIN))
        try:
            arm.connect()
            resources.answer = answer
            arm.start_move(slowly(tuple(angle + 0.3 for angle in ABB_HOME)))
            assert until(lambda: arm.state().fault is not None)
            assert words in arm.state().fault
        finally:
            arm.close()


# ---- the cell file's side --------------------------------------------------------------------


def robot(**more):
    return AbbRobot.model_validate(
        {"driver": "abb", "model": "irb140", "address": "10.0.0.1", **more}
    )


def test_the_factory_password_is_used_only_where_the_cell_file_says_so(monkeypatch):
    for name in ("CELL_ROBOT_USER", "CELL_ROBOT_PASSWORD"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match="factory_password: true"):
        abb_settings(robot())
    assert abb_settings(robot(factory_password=True)).login == FACTORY_LOGIN


def test_a_login_comes_from_the_environment(monkeypatch):
    monkeypatch.setenv("CELL_ROBOT_USER", "cell")
    monkeypatch.setenv("CELL_ROBOT_PASSWORD", SECRET)
    assert abb_settings(robot()).login == Login("cell", SECRET)


def test_a_login_comes_from_a_file(tmp_path):
    path = tmp_path / "login"
    path.write_text(f"cell\n{SECRET}\n")
    assert abb_settings(robot(credentials_file=path)).login == Login("cell", SECRET)


@pytest.mark.parametrize("content", [b"", SECRET.encode(), b"\xff" + SECRET.encode(), b"a\nb\nc"])
def test_a_file_that_is_no_login_is_refused_without_its_content(tmp_path, content):
    path = tmp_path / "login"
    path.write_bytes(content)
    with pytest.raises(InputError) as refused:
        abb_settings(robot(credentials_file=path))
    assert SECRET not in str(refused.value)


def test_a_password_does_not_belong_in_a_cell_file():
    with pytest.raises(ValueError, match="credentials_file") as refused:
        robot(password=SECRET)
    [error] = refused.value.errors()
    assert SECRET not in error["msg"]


def test_a_slow_answer_is_given_up():
    with controller() as peer:
        rws = open_rws(peer.url, ABBSettings(login=FACTORY_LOGIN, read_timeout_s=0.3), 1)
        rws.get_execution_state()
        peer.faults.mute = True
        begin_s = time.monotonic()
        with pytest.raises(OSError, match="timed out"):
            rws.get_execution_state()
        assert time.monotonic() - begin_s < 2.0
        peer.faults.mute = False
