"""A client against a MOOSDB: the stand-in, and the real one where it is on the path."""

import contextlib
import os
import shutil
import signal
import socket
import struct
import subprocess
import threading
import time

import pytest
from steerclear.experiments.deploy.demo import free_ports
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.moos import client as client_module
from steerclear.shield.bridge.moos.client import MoosClient
from steerclear.shield.bridge.moos.stand_in import StandInDb
from steerclear.shield.bridge.moos.wire import PROTOCOL, Message, pack_packet, timing
from waiting import until


@contextlib.contextmanager
def client_of(port, name="gate", variables=("A", "B"), warp=1.0, **more):
    heard = []
    clock = MonotonicClock(warp)
    client = MoosClient(name, "127.0.0.1", port, clock, variables, lambda m, s: heard.append((m, s)), **more)
    client.start()
    try:
        yield client, heard
    finally:
        client.close()


@contextlib.contextmanager
def real_db(warp=1.0):
    if shutil.which("MOOSDB") is None:
        pytest.skip("MOOSDB is not on the path; the stand-in is tested instead")
    (port,) = free_ports(1)
    arguments = ["MOOSDB", f"--moos_port={port}", "--moos_community=real", f"--moos_time_warp={warp:g}"]
    process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(1.0)
    try:
        yield port, process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def any_db(kind, warp=1.0):
    if kind == "real":
        with real_db(warp) as (port, _):
            yield port
    else:
        with StandInDb("alpha", warp=warp) as db:
            yield db.port


@pytest.mark.parametrize("kind", ["stand-in", "real"])
@pytest.mark.parametrize("warp", [1.0, 5.0])
def test_a_post_comes_back_stamped_in_moos_time(kind, warp):
    with any_db(kind, warp) as port, client_of(port, warp=warp) as (client, heard):
        assert until(lambda: client.connected)
        assert client.post({"A": 1.25, "B": "text"})
        assert until(lambda: len(heard) == 2)
        first, second = heard[0][0], heard[1][0]
        assert (first.key, first.value, first.source) == ("A", 1.25, "gate")
        assert (second.key, second.text) == ("B", "text")
        assert abs(first.time_s - time.time() * warp) < 1.0 * warp
        assert abs(client.clock_s(first.time_s) - heard[0][1]) < 0.1 * warp
        assert client.health().community in ("alpha", "real")
        assert client.health().round_trip_s < 0.5


@pytest.mark.parametrize("kind", ["stand-in", "real"])
def test_another_warp_is_refused_with_the_remedy(kind):
    with any_db(kind, 5.0) as port, client_of(port, warp=1.0) as (client, _):
        assert until(lambda: "MOOSTimeWarp 5" in client.health().fault)
        assert "--speed 5" in client.health().fault
        assert not client.connected
        assert not client.post({"A": 1.0})


@pytest.mark.parametrize("kind", ["stand-in", "real"])
def test_a_second_client_of_the_name_is_told_and_gets_in_once_the_first_is_gone(kind):
    with any_db(kind) as port, client_of(port) as (first, _), client_of(port) as (second, _):
        assert until(lambda: first.connected or second.connected)
        loser = second if first.connected else first
        assert until(lambda: "already exists" in loser.health().fault)
        (first if loser is second else second).close()
        assert until(lambda: loser.connected, 12.0)


def test_who_is_not_there_is_told_and_found_later():
    (port,) = free_ports(1)
    with client_of(port) as (client, heard):
        assert until(lambda: "start it, or correct the address" in client.health().fault)
        with StandInDb("alpha", port) as db:
            assert until(lambda: client.connected)
            db.post("A", 3.0, "somebody")
            assert until(lambda: heard and heard[-1][0].value == 3.0)
        assert until(lambda: not client.connected)
        with StandInDb("alpha", port) as db:  # registers anew by itself
            assert until(lambda: client.connected)
            db.post("A", 4.0, "somebody")
            assert until(lambda: heard[-1][0].value == 4.0)
        assert client.health().sessions == 2


def test_a_frozen_moosdb_is_given_up_for_its_silence_and_found_again(monkeypatch):
    monkeypatch.setattr(client_module, "DEAD_S", 1.5)
    ends = []
    with StandInDb("alpha") as db, client_of(db.port, lost=lambda: ends.append(time.monotonic())) as (client, _):
        assert until(lambda: client.connected)
        db.frozen.set()
        began = time.monotonic()
        assert client.post({"A": 1.0})  # taken as before: silence alone shows it
        assert until(lambda: bool(ends), 4.0)
        assert ends[0] - began < 1.5 + client_module.BEAT_S + 0.5
        assert not client.post({"A": 2.0})
        db.frozen.clear()
        assert until(lambda: client.connected, 12.0)


def test_a_real_frozen_moosdb_is_given_up_for_its_silence_and_found_again():
    with real_db() as (port, process), client_of(port) as (client, _):
        assert until(lambda: client.connected)
        os.kill(process.pid, signal.SIGSTOP)
        assert until(lambda: not client.connected, 5.0)
        os.kill(process.pid, signal.SIGCONT)
        assert until(lambda: client.connected, 15.0)


def test_a_moosdb_that_does_not_read_costs_no_memory_and_no_time(monkeypatch):
    monkeypatch.setattr(client_module, "MOST_WAITING", 4096)
    with StandInDb("alpha") as db, client_of(db.port) as (client, _):
        assert until(lambda: client.connected)
        db.frozen.set()
        text, began = "x" * 60_000, time.monotonic()
        refused = sum(not client.post({"B": text}) for _ in range(200))
        assert refused > 100
        assert time.monotonic() - began < 2.0
        assert len(client._waiting) <= 4096 + 70_000


class Liar(threading.Thread):
    """A server that welcomes and then says what it is given."""

    def __init__(self, *speeches):
        super().__init__(daemon=True)
        self.server = socket.create_server(("127.0.0.1", 0))
        self.port = self.server.getsockname()[1]
        self.speeches = list(speeches)
        self.opened = []
        self.start()

    def run(self):
        welcome = pack_packet([Message("W", community="liar", value=0.1, text="asynchronous")])
        with contextlib.suppress(OSError):
            for speech in self.speeches:
                wire, _ = self.server.accept()
                self.opened.append(wire.recv(32))
                wire.sendall(welcome + pack_packet([timing(1.0)]) + speech)
                with contextlib.suppress(OSError):
                    while wire.recv(4096):
                        pass
                wire.close()


GOOD = pack_packet([Message("N", "A", "D", "sim", 5.0, 1.0)])


@pytest.mark.parametrize(
    "speech",
    [
        struct.pack("<i", 2**31 - 1),
        struct.pack("<i", -5),
        GOOD[:4] + struct.pack("<i", 7) + GOOD[8:],
        GOOD[:23] + struct.pack("<i", 2**30) + GOOD[27:],
        b"GET / HTTP/1.1\r\n\r\n" * 4,
    ],
)
def test_damaged_packets_close_the_connection_and_are_told(speech):
    liar = Liar(speech, GOOD)
    with client_of(liar.port) as (client, heard):
        assert until(lambda: client.health().damaged == 1)
        assert until(lambda: bool(heard))  # and the next connection works
        assert liar.opened[0] == PROTOCOL
    liar.server.close()
