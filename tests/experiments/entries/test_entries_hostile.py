"""Whatever an entry does, the game goes on in time, what it did is named, and nothing of it is left."""

import os
import socket
import time

import pytest
from steerclear import policies
from steerclear.experiments.entries import team as process
from steerclear.experiments.entries.sandbox import Limits, unlimited
from steerclear.experiments.entries.team import EntryTeam
from steerclear.shield.exceptions import PolicyError

HELD = dict.fromkeys(["agent_0", "agent_1", "agent_2"], policies.HOLD)
SMALL = Limits(memory_bytes=1 << 30, file_bytes=1 << 20, written_bytes=8 << 20, output_bytes=1 << 20, processes=4)

FORFEITS = {
    "it exits": ("os._exit(0)", "ended itself with exit status 0"),
    "it is killed": ("os.kill(os.getpid(), 9)", "ended by SIGKILL"),
    "it hangs": ("while True: pass", "did not answer within 1 s"),
    "it forks for ever": ("while True: os.fork()", "more than 4 processes"),
    "its forks leave its group": (
        "for _ in range(12):\n    if os.fork() == 0:\n        os.setsid()\n        time.sleep(600)\ntime.sleep(600)",
        "more than 4 processes",
    ),
    "it fills the disk": (
        "for k in range(600):\n    open(f'junk{k}', 'wb').write(bytes(100_000))\ntime.sleep(600)",
        "wrote more than 0.0078125 GiB",
    ),
    "it prints without end": ("while True: print('x' * 10_000)", "printed more than|wrote more than"),
    "it takes memory in small pieces": (
        "kids = [os.fork() for _ in range(2)]\nkept = bytearray(b'x') * 300_000_000\ntime.sleep(600)",
        "more than 1 GiB of memory",
    ),
    "it ends its keeper": ("os.kill(os.getppid(), 9)\ntime.sleep(600)", "ended by SIGKILL"),
    "it stops its keeper": ("os.kill(os.getppid(), 19)\ntime.sleep(600)", "stopped the process that watches it"),
    "it writes into our pipe": ("os.write(int(sys.argv[2]), b'\\xff' * 64)\ntime.sleep(600)", "a message of"),
    "it answers for us": (
        "import struct\nos.write(int(sys.argv[2]), struct.pack('!i', 2) + b'[]')\nreturn 4",
        "no object|not asked",
    ),
    "it closes all": ("os.closerange(0, 256)\nreturn 4", "did not answer within 1 s|exit status"),
}


@pytest.mark.parametrize("what", FORFEITS)
def test_an_entry_that_is_ended_forfeits_its_moves_and_the_game_goes_on(team_of, play, what):
    body, words = FORFEITS[what]
    team = team_of(body, 1.0 if "1 s" in words else 20.0, limits=SMALL)
    began_s = time.monotonic()
    assert play(team, 3) == [HELD] * 3
    assert time.monotonic() - began_s < 20.0
    (failure,) = team.report().failures
    assert (failure.kind, failure.step, failure.count) == ("process ended", 0, 9)
    assert any(part in failure.message for part in words.split("|")), failure.message
    assert "hold for the rest of the game" in team.held["agent_0"]


def test_an_entry_that_stops_its_keeper_and_plays_on_is_ended(team_of, game):
    team = team_of("os.kill(os.getppid(), 19)\nreturn 4", limits=SMALL)
    env, observations, infos = game
    team.reset(env, list(HELD), 0)
    by = time.monotonic() + 10.0
    while team.act(observations, infos) != HELD:  # on a busy machine the stop takes its time
        assert time.monotonic() < by, "it plays on"
    (failure,) = team.report().failures
    assert "stopped the process that watches it" in failure.message


MISTAKES = {
    "it raises": ("raise RuntimeError('sunk')", "raised RuntimeError", "sunk"),
    "it calls exit": ("sys.exit(0)", "raised SystemExit", ""),
    "it interrupts": ("raise KeyboardInterrupt", "raised KeyboardInterrupt", ""),
    "it answers NaN": ("return (float('nan'), 1.0)", "not finite", "nan"),
    "it takes 10 GB": ("return bytearray(10 << 30)", "raised MemoryError", ""),
    "it writes a large file": ("open('big', 'wb').write(bytes(2 << 20))", "raised OSError", "File too large"),
    "it answers an object": ("return object()", "no action", "object at"),
    "it answers itself": ("a = []; a.append(a); return a", "no action", ""),
    "its text cannot be had": (
        "class Shy(Exception):\n    def __str__(self): raise ValueError\nraise Shy",
        "raised Shy",
        "no text",
    ),
}


@pytest.mark.parametrize("what", MISTAKES)
def test_mistakes_are_named_as_they_are_in_our_own_process(team_of, play, what):
    body, kind, words = MISTAKES[what]
    team = team_of(body, limits=SMALL)
    assert play(team) == [HELD] * 2
    (failure,) = team.report().failures
    assert (failure.kind, failure.count) == (kind, 6)
    assert words in failure.message


def test_what_it_prints_stays_with_it_and_escape_sequences_reach_no_terminal(team_of, play, capfd, caplog):
    quiet = team_of("print('hello'); return 4 if sys.stdin.read() == '' else 16")
    assert play(quiet, 1) == [dict.fromkeys(HELD, 4)], "no standard input"
    assert "hello" in quiet._process._worker.output()
    team = team_of("print('\\x1b[2J\\x1b]0;mine\\x07', flush=True); raise RuntimeError('\\x1b[31m\\x9bred\\x00')")
    play(team)
    team.close()
    printed = capfd.readouterr()
    shown = printed.out + printed.err + caplog.text + "\n".join(team.report().lines())
    assert "red" in shown
    assert "hello" not in shown
    assert not {"\x1b", "\x9b", "\x00", "\x07"} & set(shown)


def test_what_it_leaves_running_ends_with_its_game(team_of, play, tmp_path):
    note = tmp_path / "note"
    team = team_of(
        f"""
        def go_on():
            while True:
                with open({str(note)!r}, "a") as file:
                    file.write("x")
                time.sleep(0.01)
        if agent_id == "agent_0":
            threading.Thread(target=go_on).start()
            if os.fork() == 0:
                os.setsid()
                if os.fork() == 0:
                    go_on()
                os._exit(0)
            while not os.path.exists({str(note)!r}):
                time.sleep(0.01)
        return 4
        """
    )
    assert play(team, 1) == [dict.fromkeys(HELD, 4)]
    team.close()
    size = note.stat().st_size
    time.sleep(0.2)
    assert note.stat().st_size == size > 0
    assert team.report().failures == ()


def test_what_it_leaves_running_ends_also_when_it_ended_its_keeper(team_of, play, tmp_path):
    note = tmp_path / "note"
    team = team_of(
        f"""
        keeper, child = os.getppid(), os.fork()
        if child == 0:
            os.setsid()
            if os.fork():
                os._exit(0)
            while True:
                with open({str(note)!r}, "a") as file:
                    file.write("x")
                time.sleep(0.01)
        os.waitpid(child, 0)
        while not os.path.exists({str(note)!r}):
            time.sleep(0.01)
        os.kill(keeper, 9)
        time.sleep(600)
        """
    )
    assert play(team, 1) == [HELD]
    assert "SIGKILL" in team.report().failures[0].message
    end_s, size = time.monotonic() + 10.0, -1
    while note.stat().st_size != size and time.monotonic() < end_s:
        size = note.stat().st_size
        time.sleep(0.2)
    assert note.stat().st_size == size > 0


def test_a_process_is_used_again_but_nothing_of_the_game_before_is_left(team_of, play):
    code = (
        "import builtins, numpy\n"
        "old = getattr(builtins, 'mark', None), os.environ.get('MARK'), numpy.geterr()['over']\n"
        "builtins.mark = 1; os.environ['MARK'] = '1'; numpy.seterr(over='raise'); open('left', 'w').close()\n"
        "return 4 if old == (None, None, 'warn') else 16"
    )
    first = team_of(code)
    assert play(first, 1) == [{"agent_0": 4, "agent_1": 16, "agent_2": 16}]
    first.close()
    kept = [worker._process.pid for worker in process._IDLE]
    assert kept
    second = team_of(code)
    assert second._process._worker._process.pid in kept
    assert play(second, 1) == [{"agent_0": 4, "agent_1": 16, "agent_2": 16}]
    assert "MARK" not in os.environ


@pytest.mark.skipif("network" in unlimited(), reason="this system lets nobody take the network away")
def test_it_reaches_no_network(team_of, play):
    with socket.create_server(("127.0.0.1", 0)) as server:
        reach = f"import socket; socket.create_connection({server.getsockname()!r}, 2).close(); return 4"
        team = team_of(reach)
        assert play(team, 1) == [HELD]
        assert "Network is unreachable" in team.report().failures[0].message
        assert play(team_of(reach, limits=Limits(network=True)), 1) == [dict.fromkeys(HELD, 4)]


@pytest.mark.parametrize("name", ["pipe", "pipe.zip"])
def test_a_pipe_is_no_entry_and_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(PolicyError, match=r"is no plain file; give a folder or a zip"):
        EntryTeam(str(tmp_path / name))
