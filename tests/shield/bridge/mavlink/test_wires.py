"""Wires: addresses, ports that are taken, peers that go and come back, whole frames or none."""

import contextlib
import os
import pty
import socket
import time

import pytest
from steerclear.shield.bridge.mavlink.transport import Address, SerialWire, TcpWire, UdpWire, make_wire, parse_address
from steerclear.shield.exceptions import LinkError


@contextlib.contextmanager
def closing(*things):
    try:
        yield things[0] if len(things) == 1 else things
    finally:
        for thing in things:
            thing.close()


def received(wire, count=1, seconds=5.0):
    """Bytes of one or more packets, waited for."""
    end, got = time.monotonic() + seconds, []
    while len(got) < count and time.monotonic() < end:
        packet = wire.receive()
        got.append(packet) if packet else time.sleep(0.005)
    return got


def free_port(kind=socket.SOCK_STREAM):
    with closing(socket.socket(socket.AF_INET, kind)) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextlib.contextmanager
def dialled():
    """A server, and a wire of ours that has dialled it."""
    server = socket.create_server(("127.0.0.1", 0))
    with closing(server, TcpWire(Address("tcp", "127.0.0.1", server.getsockname()[1]))) as both:
        both[1].open()
        yield both


BY_PATH = "/dev/serial/by-path/pci-0000:00:14.0-usb-0:1:1.0-port0"


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("udpin:127.0.0.1:14550", Address("udpin", "127.0.0.1", 14550)),
        ("tcp:boat.local:5760", Address("tcp", "boat.local", 5760)),
        ("udpout:[::1]:14550", Address("udpout", "::1", 14550)),
        ("serial:/dev/ttyUSB0:115200", Address("serial", "/dev/ttyUSB0", 115200)),
        ("udpin:[fe80::1%eth0]:14550", Address("udpin", "fe80::1%eth0", 14550)),
        ("serial:/dev/ttyUSB0", Address("serial", "/dev/ttyUSB0", 57600)),
        (f"serial:{BY_PATH}:115200", Address("serial", BY_PATH, 115200)),
        (f"serial:{BY_PATH}", Address("serial", BY_PATH, 57600)),
    ],
)
def test_addresses_that_are(text, address):
    assert parse_address(text) == address
    assert parse_address(str(address)) == address, "what errors name can be given"


SCOPED = ("fe80::1", 14550, 0, 7)


@pytest.mark.parametrize("kind", ["udpin", "udpout", "tcp", "tcpin"])
def test_an_address_of_one_network_alone_keeps_its_scope(kind, monkeypatch):
    given, places = [], [(socket.AF_INET6, 0, 0, "", SCOPED)]

    class Places(socket.socket):
        """Keeps the places it is given."""

        def bind(self, place):
            given.append(place)

        connect = bind

        def sendto(self, data, place):
            given.append(place)
            return len(data)

        def recvfrom(self, most):
            return b"x", SCOPED

    monkeypatch.setattr(socket, "getaddrinfo", lambda host, *_, **__: places if host == "fe80::1%eth0" else [])
    monkeypatch.setattr(socket, "socket", Places)
    with closing(make_wire(parse_address(f"{kind}:[fe80::1%eth0]:14550"))) as wire:
        wire.open()
        if kind == "udpin":
            _, peer = wire.receive()
            assert wire.send(b"y", peer)
    assert given == [SCOPED] * (1 + (kind == "udpin"))


@pytest.mark.parametrize(
    "text",
    [
        *("", "udp:127.0.0.1:14550", "udpin:", "udpin:14550", "tcp:host:", "tcp:host:99999", "tcp:host:1٣", "com3"),
        *("tcp:010.0.0.1:1", "tcp:[::zz]:1", "tcp:a b:1", "serial:", "serial::9600", "serial:/dev/ttyS0:fast"),
    ],
)
def test_addresses_that_are_not(text):
    with pytest.raises(LinkError, match="give"):
        parse_address(text)


def test_a_udp_port_that_is_taken_is_said_so():
    with closing(UdpWire(Address("udpin", "127.0.0.1", 0))) as first:
        first.open()
        second = UdpWire(Address("udpin", "127.0.0.1", first.port))
        with pytest.raises(
            LinkError, match=r"another program \(another runner\?\) uses that port: end it or give another"
        ):
            second.open()


def test_udpout_to_nobody_waits_and_does_not_fail():
    with closing(UdpWire(Address("udpout", "127.0.0.1", free_port(socket.SOCK_DGRAM)))) as wire:
        wire.open()
        for _ in range(5):
            wire.send(b"anybody there", None)
            assert wire.receive() is None


def test_a_host_that_does_not_exist_and_nobody_on_a_port_are_said_so(monkeypatch):
    def none(*args, **kwargs):
        raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", none)
    for wire in (UdpWire(Address("udpout", "nowhere", 1)), TcpWire(Address("tcp", "nowhere", 1))):
        with pytest.raises(LinkError, match="no host 'nowhere'"):
            wire.open()
    monkeypatch.undo()
    with pytest.raises(LinkError, match="nothing listens there: start the boat"):
        TcpWire(Address("tcp", "127.0.0.1", free_port())).open()


def test_tcp_lost_and_opened_again():
    with dialled() as (server, wire):
        boat, _ = server.accept()
        boat.sendall(b"one")
        assert received(wire)[0][0] == b"one"
        boat.close()
        with pytest.raises(ConnectionError):
            received(wire)
        assert wire.fileno() == -1
        assert not wire.send(b"gone", None)
        wire.open()
        with closing(server.accept()[0]) as again:
            assert wire.send(b"two", None)
            again.settimeout(5.0)
            assert again.recv(100) == b"two"


def test_tcpin_takes_one_peer_and_the_next_after_it():
    with closing(TcpWire(Address("tcpin", "127.0.0.1", 0))) as wire:
        wire.open()
        assert wire.receive() is None, "nobody is waited for"
        for text in (b"first", b"second"):
            with closing(socket.create_connection(("127.0.0.1", wire.port), 5.0)) as boat:
                boat.sendall(text)
                assert received(wire)[0][0] == text
                assert wire.send(b"ok", None)
                assert boat.recv(10) == b"ok"
            with pytest.raises(ConnectionError):
                received(wire)
        assert wire.fileno() >= 0, "it listens on"


def test_a_peer_that_does_not_read_gets_whole_frames_or_none():
    with dialled() as (server, wire), closing(server.accept()[0]) as boat:
        frame, delivered = bytes(range(256)), 0
        while wire.send(frame, None):
            delivered += 1
        assert not wire.send(frame, None), "full: said so, and not kept for later"
        boat.settimeout(5.0)
        data, size = b"", delivered * len(frame)
        while len(data) < size:
            data += boat.recv(1 << 20)
            wire.send(b"", None)
        assert data[:size] == frame * delivered


def test_a_serial_port_carries_bytes_as_they_are():
    boat, device = pty.openpty()
    name = os.ttyname(device)
    try:
        with closing(SerialWire(Address("serial", name, 57600))) as wire:
            wire.open()
            assert wire.receive() is None
            os.write(boat, b"\xfd\x00\r\n\x03\xff")
            assert received(wire)[0][0] == b"\xfd\x00\r\n\x03\xff"
            assert wire.send(b"\n\x11\x13", None)
            assert os.read(boat, 10) == b"\n\x11\x13"
    finally:
        os.close(boat)
        os.close(device)


def test_serial_ports_that_are_none(tmp_path):
    (tmp_path / "file").touch()
    for name, baud, words in (
        ("none", 57600, "no such device: plug it in"),
        ("file", 57600, "that is no serial port"),
        ("file", 12345, r"no baud rate 12345; give one of .*57600"),
    ):
        with pytest.raises(LinkError, match=words):
            SerialWire(Address("serial", str(tmp_path / name), baud)).open()


def test_a_serial_port_that_is_pulled_out_is_lost():
    boat, device = pty.openpty()
    with closing(SerialWire(Address("serial", os.ttyname(device), 57600))) as wire:
        wire.open()
        os.close(device)
        os.close(boat)
        with pytest.raises(OSError, match=r".*"):
            received(wire)
        assert wire.fileno() == -1
        assert not wire.send(b"x", None)
