"""The referee: the env's rules over boats that nobody but the water moves."""

import json
import math
import os
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.cli import app
from steerclear.experiments.deploy import referee as referee_module
from steerclear.experiments.deploy.referee import Referee
from steerclear.experiments.deploy.rules import Umpire, game_config, player_names, state_of
from steerclear.experiments.docs_keys import KEYS, undocumented
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender, Fix, GameState
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.messages import Contact
from steerclear.shield.exceptions import BridgeError, FleetFileError, GameError
from steerclear.shield.platforms import layout as L
from typer.testing import CliRunner

NAMES = ("b1", "b2", "r1", "r2")
PLACES = {"b1": (25.0, 10.0), "b2": (25.0, 30.0), "r1": (55.0, 10.0), "r2": (55.0, 30.0)}


def contacts(now_s, places=PLACES, speed=0.0, heading_deg=0.0, age_s=0.0):
    heading = math.radians(heading_deg)
    return [Contact(boat, place, heading, speed, now_s - age_s, 0.1, "hub") for boat, place in places.items()]


@pytest.fixture
def umpire():
    """A game of two against two that has begun at 100 s, boats at `PLACES`."""
    kept = Umpire(GameConfig.preset("aamas2024", team_size=2), NAMES)
    kept.watch(contacts(100.0), 100.0)
    return kept


def test_the_umpire_of_a_simulated_game_says_what_the_game_says():
    """Positions through field coordinates and radians, as boats send them: the same game, move by move."""
    dt_s = 0.125  # differences of times are exact
    config = GameConfig.preset("aamas2024", default_start=False, dt_s=dt_s)
    env = MctfEnv(config, seed=11)
    observations, infos = env.reset(seed=11)
    teams = [policies.make(name) for name in ("hard_attack", "easy")]
    for k, team in enumerate(teams):
        team.reset(env, env.possible_agents[3 * k : 3 * k + 3], 3)
    names = [f"boat {i}" for i in range(6)]
    umpire = Umpire(config, names)
    happened = set()
    for step in range(1000):
        state = env.core.state[0]
        seen = [
            Contact(name, tuple(row[:2].tolist()), math.radians(row[L.HEADING]), row[L.SPEED], step * dt_s, 0.0, "hub")
            for name, row in zip(names, state, strict=True)
        ]
        said = umpire.watch(seen, step * dt_s)
        happened |= {text.split(" ", 2)[2].partition(":")[0] for text in umpire.events if text.startswith("boat")}
        env.core.commands(np.zeros((1, 6, 2)))
        truth = state_of(env.core, names)
        assert said == truth, step
        actions = {}
        for team in teams:
            actions |= team.act(observations, infos)
        observations, *_, infos = env.step(actions)
    assert {"grabs the flag", "is free again"} <= happened, happened


def test_it_waits_for_all_boats_and_says_for_whom():
    umpire = Umpire(GameConfig.preset("aamas2024", team_size=2), NAMES)
    state = umpire.watch([], 5.0)
    assert state.note == "waiting for b1, b2, r1, r2"
    assert state.time_s == 0.0
    assert not any(status.tagged or status.driven for status in state.boats.values())
    some = {name: place for name, place in PLACES.items() if name != "r2"}
    assert umpire.watch(contacts(6.0, some), 6.0).note == "waiting for r2"
    assert umpire.watch(contacts(7.0, PLACES, age_s=30.0), 7.0).note == "waiting for boats that are lost"
    assert not umpire.began
    assert umpire.watch(contacts(8.0), 8.0).note == ""
    assert umpire.events == ("the game begins",)
    assert umpire.watch(contacts(9.5), 9.5).time_s == pytest.approx(1.5)


def test_a_tag_is_told_and_the_tagged_boat_is_driven(umpire):
    raid = {**PLACES, "r1": (33.0, 10.0)}
    umpire.watch(contacts(100.1, raid), 100.1)
    state = umpire.watch(contacts(100.2, raid), 100.2)
    assert "b1 tags r1" in umpire.events
    assert state.boats["r1"].tagged
    assert state.boats["r1"].driven
    assert state.tags == (1, 0)
    assert state.boats["b1"].cooldown_s == 0.0


def test_fixes_are_carried_forward_but_not_far(umpire):
    umpire.watch(contacts(101.0, PLACES, speed=2.0, heading_deg=90.0, age_s=0.5), 101.0)
    assert umpire.core.state[0, 0, :2] == pytest.approx((26.0, 10.0))
    umpire.watch(contacts(102.0, PLACES, speed=2.0, heading_deg=90.0, age_s=4.0), 102.0)
    assert umpire.core.state[0, 0, :2] == pytest.approx((27.0, 10.0))


def test_a_boat_not_heard_of_any_more_is_out_until_it_is_again(umpire):
    known = contacts(100.0)[:1]
    others = {name: place for name, place in PLACES.items() if name != "b1"}
    state = umpire.watch(known + contacts(104.9, others), 104.9)
    assert not state.boats["b1"].oob
    state = umpire.watch(known + contacts(105.1, others), 105.1)
    assert state.boats["b1"].oob
    assert state.boats["b1"].tagged
    assert state.note == "lost, so out of bounds: b1"
    assert "b1 is out of bounds" in umpire.events
    state = umpire.watch(contacts(105.2, {**PLACES, "b1": (12.0, 20.0)}), 105.2)
    assert not state.boats["b1"].oob
    assert not state.boats["b1"].tagged
    assert "b1 is free again" in umpire.events


def test_strangers_on_the_feed_change_nothing(umpire):
    state = umpire.watch(contacts(100.1, {**PLACES, "ferry": (26.0, 11.0)}), 100.1)
    assert set(state.boats) == set(NAMES)


def test_a_game_that_is_over_stands_as_it_ended():
    umpire = Umpire(GameConfig.preset("aamas2024", team_size=2, max_time_s=2.0), NAMES)
    umpire.watch(contacts(0.0), 0.0)
    state = umpire.watch(contacts(2.5), 2.5)
    assert state.over
    assert umpire.events == ("the game is over",)
    umpire.watch(contacts(3.0), 3.0)
    state = umpire.watch(contacts(3.5, {**PLACES, "r1": (33.0, 10.0)}), 3.5)
    assert state.tags == (0, 0)
    assert state.time_s == pytest.approx(2.5)
    assert umpire.events == ()


def test_time_never_goes_back(umpire):
    umpire.watch(contacts(103.0), 103.0)
    assert umpire.watch(contacts(90.0), 90.0).time_s == pytest.approx(3.0)


def test_names_must_fit_the_game():
    with pytest.raises(GameError, match="3 names for 4 boats"):
        Umpire(GameConfig.preset("aamas2024", team_size=2), NAMES[:3])


@pytest.fixture
def fleet_file(tmp_path, fleet_of):
    """A FLEET.yaml of one against one whose runner and referee hear at free ports."""

    def build(referee='referee: "127.0.0.1:{port}"'):
        text = f"""
version: 1
field: {{origin: {{latitude_deg: 42.0, longitude_deg: -71.0}}, size_m: [80, 40], y_axis_deg: 20.0}}
geofence: {{xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}}
team: blue
rules: {{max_time_s: 2.0}}
feed: {{listen: "127.0.0.1:{free_port()}"{", " + referee.format(port=free_port()) if referee else ""}}}
boats:
  - {{name: b1, agent: agent_0, platform: heron, link: {{kind: mavlink, address: "udpin:127.0.0.1:1", system_id: 1}}}}
  - {{name: r1, agent: agent_1, platform: heron, contact: feed}}
"""
        path = tmp_path / "FLEET.yaml"
        path.write_text(text)
        return path

    return build


@pytest.fixture(autouse=True)
def _brief_endings(monkeypatch):
    monkeypatch.setattr(referee_module, "LINGER_S", 0.3)


def free_port():
    with FeedReceiver("127.0.0.1:0", None, ManualClock()) as receiver:
        return receiver.address.rpartition(":")[2]


class Hub:
    """Sends positions in the field's frame at some rate until it is closed."""

    def __init__(self, fleet, places):
        self._sender = FeedSender("hub", [fleet.feed.referee])
        self._fixes = [
            Fix(boat, *fleet.frame.to_geodetic_deg(*place), fleet.field.y_axis_deg, 0.0, 0.0, 0.1)
            for boat, place in places.items()
        ]
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self):
        while not self._closing.wait(0.02):
            self._sender.send_positions(self._fixes)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._closing.set()
        self._thread.join()
        self._sender.close()


def test_runners_hear_how_the_game_stands_over_the_feed(fleet_file):
    fleet = load_fleet(fleet_file())
    clock = MonotonicClock()
    told = []
    with (
        FeedReceiver(fleet.feed.listen, fleet.frame, clock, boats=fleet.names) as runner,
        Referee(fleet, clock) as referee,
        Hub(fleet, {"b1": (33.0, 20.0), "r1": (34.0, 20.0)}),
    ):
        why = referee.run(lambda state, events: told.extend(events), lambda: False, rate_hz=20.0, limit_s=60.0)
        last = runner.game()
    assert why == "over"
    assert told[0] == "the game begins"
    assert isinstance(last, GameState)
    assert last.over
    assert last.boats["r1"].tagged, "one blue boat at its side, one red boat beside it"
    assert referee.umpire.core.state[0, 0, :2] == pytest.approx((33.0, 20.0), abs=1e-3)


def test_it_stops_when_told_and_when_time_is_up(fleet_file):
    fleet = load_fleet(fleet_file())
    with Referee(fleet, ManualClock(), publish=["127.0.0.1:9"]) as referee:
        looks = []
        assert referee.run(lambda state, events: looks.append(state.note), lambda: len(looks) == 3) == "stopped"
        assert looks == ["waiting for b1, r1"] * 3
        assert referee.run(lambda state, events: None, lambda: False, limit_s=2.0) == "time"


def test_without_addresses_or_players_there_is_no_referee(fleet_file, fleet_of):
    with pytest.raises(FleetFileError, match=r"add feed\.referee"):
        Referee(load_fleet(fleet_file(referee="")), ManualClock())
    fleet = load_fleet(fleet_file())
    with Referee(fleet, ManualClock()), pytest.raises(BridgeError, match="cannot hear the feed"):
        Referee(fleet, ManualClock())
    nobody = fleet_of(1).model_copy(update={"boats": (fleet_of(1).boat("rescue"),)})
    with pytest.raises(FleetFileError, match="no boat plays"):
        Referee(nobody, ManualClock())
    assert player_names(fleet_of(1)) == ("blue_1", "red_1")
    assert game_config(fleet_of(1)).n_boats == 2


def test_the_command_keeps_a_game(fleet_file, tmp_path):
    path = fleet_file()
    with Hub(load_fleet(path), {"b1": (33.0, 20.0), "r1": (60.0, 20.0)}):
        result = CliRunner().invoke(app, ["referee", str(path), "--json", str(tmp_path / "game.json")])
    assert result.exit_code == 0, result.output
    assert "the game begins" in result.output
    content = json.loads((tmp_path / "game.json").read_text())
    assert undocumented(content, KEYS["referee"]) == []
    assert content["ended"] == "over"
    assert content["game"]["over"]
    assert content["events"][0]["text"] == "the game begins"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--rate", "0"], "--rate is 0"),
        (["--minutes", "-1"], "--minutes is -1"),
        (["--listen", "here"], "HOST:PORT"),
        (["--publish", "there"], "HOST:PORT"),
        (["--speed", "0"], "clock speed"),
    ],
)
def test_bad_options_are_one_line_and_status_2(fleet_file, options, words):
    result = CliRunner().invoke(app, ["referee", str(fleet_file()), *options])
    assert result.exit_code == 2
    assert words in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_an_interrupted_referee_says_so(fleet_file):
    path = fleet_file()
    process = subprocess.Popen(
        [sys.executable, "-m", "steerclear.experiments.cli", "referee", str(path)],
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        with Hub(load_fleet(path), {"b1": (33.0, 20.0), "r1": (60.0, 20.0)}):
            assert "the game begins" in process.stdout.readline()
            os.kill(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=60.0)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode == 130
    assert "interrupted" in said
