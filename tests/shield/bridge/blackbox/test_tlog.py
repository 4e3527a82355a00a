"""The tlog: every packet, with its time, as pymavlink's own reader finds it."""

import struct

import pytest
from hypothesis import settings
from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.blackbox import TlogWriter
from steerclear.shield.exceptions import BridgeError

quick = settings(max_examples=100, deadline=None, derandomize=True)
START_US = 1_790_000_000_000_000


def packets(count, signed=False, first=False):
    """Heartbeats and attitudes as bytes; MAVLink 1 where ``first``."""
    link = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    if signed:
        link.signing.secret_key, link.signing.sign_outgoing = b"k" * 32, True
    found = []
    for k in range(count):
        message = (
            link.attitude_encode(k, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0) if k % 2 else link.heartbeat_encode(10, 3, 0, k, 0)
        )
        found.append(bytes(message.pack(link, force_mavlink1=first)))
    return found


def read(path):
    log = mavutil.mavlink_connection(str(path))
    found = []
    while (message := log.recv_match()) is not None:
        found.append((message.get_type(), round(message._timestamp * 1e6), bytes(message.get_msgbuf())))
    log.close()
    return found


@pytest.mark.parametrize("kind", [{}, {"signed": True}, {"first": True}])
def test_pymavlink_reads_every_packet_with_its_time(tmp_path, kind):
    sent = packets(20, **kind)
    writer = TlogWriter(tmp_path / "run.tlog")
    for k, packet in enumerate(sent):
        writer.on_bytes("in", packet, START_US + 1000 * k)
    writer.close()
    found = read(tmp_path / "run.tlog")
    assert [packet for _, _, packet in found] == sent
    assert [kind for kind, _, _ in found] == ["HEARTBEAT", "ATTITUDE"] * 10
    assert all(abs(time_us - START_US - 1000 * k) <= 4 for k, (_, time_us, _) in enumerate(found))
    assert writer.fault == ""


def test_directions_are_told_apart_in_the_lowest_bits(tmp_path):
    one, two = packets(2)
    writer = TlogWriter(tmp_path / "run.tlog")
    writer.on_bytes("in", one, START_US)
    writer.on_bytes("out", two, START_US)
    writer.close()
    raw = (tmp_path / "run.tlog").read_bytes()
    assert struct.unpack(">Q", raw[:8])[0] & 3 == 0
    assert struct.unpack(">Q", raw[8 + len(one) : 16 + len(one)])[0] & 3 == 1


def test_a_closed_tlog_raises_nothing_at_the_link(tmp_path):
    writer = TlogWriter(tmp_path / "run.tlog")
    writer.close()
    writer.on_bytes("in", packets(1)[0], START_US)
    with pytest.raises(BridgeError, match="exists already"):
        TlogWriter(tmp_path / "run.tlog")
