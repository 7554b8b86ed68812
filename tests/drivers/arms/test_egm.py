"""EGM feedback: who is believed, and what."""

import logging
import socket
from contextlib import closing, suppress

import numpy as np
import pytest
from ABBRobotEGM._egm_protobuf import egm_pb2
from benches import ABB_HOME, free_udp_port, until
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform

from drivers.abb import egm
from drivers.abb.egm import EgmReader
from drivers.abb.egm_message import EgmDecoder, NotBelieved
from drivers.abb.settings import IRB140_LIMITS_RAD
from sim.peers.loopback import own_address

TURN = (0.5, 0.5, -0.5, 0.5)


def message(number=1, clock_ms=1000, joints_deg=None, mm=(515.0, 0.0, 712.0), wxyz=TURN, kind=2):
    robot = egm_pb2.EgmRobot()
    robot.header.seqno, robot.header.tm = number, clock_ms
    robot.header.mtype = kind
    joints = np.degrees(ABB_HOME).tolist() if joints_deg is None else joints_deg
    robot.feedBack.joints.joints.extend(joints)
    position, turn = robot.feedBack.cartesian.pos, robot.feedBack.cartesian.orient
    position.x, position.y, position.z = mm
    turn.u0, turn.u1, turn.u2, turn.u3 = wxyz
    return robot.SerializeToString()


class Wire:
    """A reader, and a controller and a stranger that send to it."""

    def __init__(self):
        address = own_address()
        self.port = free_udp_port()
        self.reader = EgmReader(
            self.port, f"http://{address}:80", RigidTransform.identity(), IRB140_LIMITS_RAD
        )
        self.controller, self.stranger = (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)
        )
        self.controller.bind((address, 0))

    def close(self):
        self.reader.close()
        self.controller.close()
        self.stranger.close()

    def sends(self, datagram, sender=None):
        (sender or self.controller).sendto(datagram, ("127.0.0.1", self.port))

    def believes(self, datagram):
        """Whether the newest reading becomes the one of this datagram."""
        seen = self.reader.refused.total(), self.reader._newest
        self.sends(datagram)
        assert until(lambda: (self.reader.refused.total(), self.reader._newest) != seen)
        return self.reader._newest is not seen[1]


@pytest.fixture
def wire():
    with closing(Wire()) as made:
        yield made


@pytest.fixture
def patient(monkeypatch):
    """On a busy machine a stream would count as silent, and the next datagram as a new one's."""
    monkeypatch.setattr(egm, "_FRESH_S", 60.0)


def test_a_reading_of_the_controllers_is_believed(wire, patient):
    assert wire.believes(message())
    reading = wire.reader.fresh()
    assert reading.joints_rad == pytest.approx(ABB_HOME)
    assert reading.controller_t_s == 1.0
    assert reading.raw["trans_mm"] == [515.0, 0.0, 712.0]


def test_nothing_is_believed_from_another_address(wire, caplog):
    wire.sends(message(number=5), wire.stranger)
    assert until(lambda: wire.reader.refused.total() == 1)
    assert wire.reader.fresh() is None
    assert "it comes from 127.0.0.1, not from 127." in caplog.text
    assert wire.believes(message(number=1))


BAD = [
    ("no EGM message", b"\xff\xfe garbage"),
    ("no EGM message with a reading", message(kind=0)),
    ("not have six joints", message(joints_deg=[1.0, 2.0])),
    ("not have six joints", message(joints_deg=[0.0] * 7)),
    ("joint angle is not finite", message(joints_deg=[float("nan")] + [0.0] * 5)),
    ("position is not finite", message(mm=(float("inf"), 0.0, 0.0))),
    ("quaternion is not finite", message(wxyz=(float("nan"), 0.0, 0.0, 0.0))),
    ("length 1", message(wxyz=(0.0, 0.0, 0.0, 0.0))),
    ("not have length 1", message(wxyz=(0.5, 0.5, 0.5, 0.6))),
    ("m away", message(mm=(2e5, 0.0, 0.0))),
    ("joint 3 stands at", message(joints_deg=[0.0, 0.0, 120.0, 0.0, 0.0, 0.0])),
]


@pytest.mark.parametrize(("words", "datagram"), BAD)
def test_what_cannot_be_a_reading_is_dropped_and_reported_and_the_next_one_counts(
    wire, caplog, words, datagram, patient
):
    assert not wire.believes(datagram)
    assert words in caplog.text
    assert wire.believes(message())
    assert wire.reader.fresh().raw["datagrams_refused"] == 1


@pytest.mark.parametrize("number", [10, 9, 1])
def test_a_datagram_that_was_overtaken_or_is_sent_again_is_not_the_newest(wire, number, patient):
    assert wire.believes(message(number=10, clock_ms=1000))
    assert not wire.believes(message(number=number, clock_ms=1008))
    assert wire.believes(message(number=11, clock_ms=1008))


def test_a_count_that_wraps_goes_on(wire):
    assert wire.believes(message(number=2**32 - 1, clock_ms=2**32 - 4))
    assert wire.believes(message(number=0, clock_ms=0))


def test_a_clock_that_stands_gives_no_fresh_reading_ever(wire):
    assert wire.believes(message(number=1, clock_ms=1000))
    assert until(lambda: wire.reader.fresh() is None)
    assert not wire.believes(message(number=2, clock_ms=1000))
    assert wire.reader.fresh() is None


def test_a_new_stream_counts_from_its_own_beginning(wire):
    assert wire.believes(message(number=500, clock_ms=1000))
    assert until(lambda: wire.reader.fresh() is None)
    assert wire.believes(message(number=1, clock_ms=2000))


def test_a_flood_is_reported_once_for_a_reason_and_the_reader_lives(wire, caplog):
    caplog.set_level(logging.WARNING)
    for n in range(300):
        wire.sends(bytes([n % 256]) * (n % 50))
        wire.sends(message(number=n), wire.stranger)
    assert until(lambda: wire.reader.refused.total() > 100)
    # as many words as reasons, however many datagrams the system dropped before they were read
    assert len(caplog.records) == len(wire.reader.refused) <= 3

    def heard():
        # what is left of the flood is refused meanwhile, and a datagram may be dropped by it
        wire.sends(message(number=7))
        return wire.reader._newest is not None

    assert until(heard)


@given(st.binary(max_size=600))
@settings(max_examples=300, deadline=None)
def test_no_bytes_raise_anything_but_a_named_refusal(datagram):
    with suppress(NotBelieved):
        EgmDecoder(IRB140_LIMITS_RAD).decode(datagram)
