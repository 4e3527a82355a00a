"""The referee: the rules of the env over boats that nobody but the water moves, heard by the feed."""

import contextlib
import json
import math
import os
import signal

import numpy as np
import pytest
from json_keys import KEYS, undocumented
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.cli import app
from steerclear.experiments.deploy import referee as referee_module
from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.deploy.referee import Referee, Umpire, game_config, game_obstacles, player_names, state_of
from steerclear.experiments.sim_boats import AutopilotSettings, SimFleet
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.bridge.feed import FeedReceiver
from steerclear.shield.bridge.feed_packets import FeedSender, Fix, GameState
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet
from steerclear.shield.bridge.messages import Contact
from steerclear.shield.exceptions import BridgeError, FleetFileError, GameError
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER
from steerclear.shield.wrappers.mctf import MctfReader
from typer.testing import CliRunner
from waiting import repeating, wait_for

NAMES = ("b1", "b2", "r1", "r2")
PLACES = {"b1": (25.0, 10.0), "b2": (25.0, 30.0), "r1": (55.0, 10.0), "r2": (55.0, 30.0)}


def text_of(seconds=600.0):
    """A file of one against one, both with links, on free ports."""
    blue, red, listen, referee = free_ports(4)
    link = 'link: {kind: mavlink, address: "udpin:127.0.0.1:%d", system_id: %d}'
    return f"""
version: 1
field: {{origin: {{latitude_deg: 42.0, longitude_deg: -71.0}}, size_m: [80, 40], y_axis_deg: 20.0}}
geofence: {{xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}}
team: blue
rules: {{max_time_s: {seconds}}}
feed: {{listen: "127.0.0.1:{listen}", referee: "127.0.0.1:{referee}"}}
boats:
  - {{name: b1, agent: agent_0, platform: heron, {link % (blue, 1)}}}
  - {{name: r1, agent: agent_1, platform: heron, {link % (red, 2)}}}
"""


@pytest.fixture
def fleet_file(tmp_path):
    """The file of a game of two seconds."""
    path = tmp_path / "FLEET.yaml"
    path.write_text(text_of(2.0))
    return path


@pytest.fixture(autouse=True)
def _brief_endings(monkeypatch):
    monkeypatch.setattr(referee_module, "LINGER_S", 0.3)


def contacts(now_s, places=PLACES, speed=0.0, heading_deg=0.0, age_s=0.0):
    heading = math.radians(heading_deg)
    return [Contact(boat, place, heading, speed, now_s - age_s, 0.1, "hub") for boat, place in places.items()]


def umpire_of(**settings):
    return Umpire(GameConfig.preset("aamas2024", team_size=2, **settings), NAMES)


@pytest.fixture
def umpire():
    """A game of two against two that has begun at 100 s, boats at `PLACES`."""
    kept = umpire_of()
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
    umpire, happened = Umpire(config, names), set()
    for step in range(1000):
        seen = [
            Contact(name, tuple(row[:2].tolist()), math.radians(row[L.HEADING]), row[L.SPEED], step * dt_s, 0.0, "hub")
            for name, row in zip(names, env.core.state[0], strict=True)
        ]
        said = umpire.watch(seen, step * dt_s)
        happened |= {text.split(" ", 2)[2].partition(":")[0] for text in umpire.events if text.startswith("boat")}
        env.core.commands(np.zeros((1, 6, 2)))
        assert said == state_of(env.core, names), step
        actions = {}
        for team in teams:
            actions |= team.act(observations, infos)
        observations, *_, infos = env.step(actions)
        if step > 300 and {"grabs the flag", "is free again"} <= happened:
            return
    pytest.fail(f"happened: {happened}")


def test_it_waits_for_all_boats_and_says_for_whom():
    umpire = umpire_of()
    state = umpire.watch([], 5.0)
    assert (state.note, state.time_s) == ("waiting for b1, b2, r1, r2", 0.0)
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
    state = umpire.watch(contacts(100.2, {**raid, "ferry": (26.0, 11.0)}), 100.2)
    assert set(state.boats) == set(NAMES), "strangers on the feed change nothing"
    assert "b1 tags r1" in umpire.events
    assert state.boats["r1"].tagged
    assert state.boats["r1"].driven
    assert state.tags == (1, 0)
    assert state.boats["b1"].cooldown_s == 0.0


def test_a_boat_not_heard_of_any_more_is_out_until_it_is_again(umpire):
    known = contacts(100.0)[:1]
    others = {name: place for name, place in PLACES.items() if name != "b1"}
    assert not umpire.watch(known + contacts(104.9, others), 104.9).boats["b1"].oob
    state = umpire.watch(known + contacts(105.1, others), 105.1)
    assert state.boats["b1"].oob
    assert state.boats["b1"].tagged
    assert state.note == "lost, so out of bounds: b1"
    assert "b1 is out of bounds" in umpire.events
    state = umpire.watch(contacts(105.2, {**PLACES, "b1": (12.0, 20.0)}), 105.2)
    assert not state.boats["b1"].oob
    assert not state.boats["b1"].tagged
    assert "b1 is free again" in umpire.events


def test_a_game_that_is_over_stands_as_it_ended():
    umpire = umpire_of(max_time_s=2.0)
    umpire.watch(contacts(0.0), 0.0)
    assert umpire.watch(contacts(2.5), 2.5).over
    assert umpire.events == ("the game is over",)
    umpire.watch(contacts(3.0), 3.0)
    state = umpire.watch(contacts(3.5, {**PLACES, "r1": (33.0, 10.0)}), 3.5)
    assert (state.tags, state.time_s, umpire.events) == ((0, 0), pytest.approx(2.5), ())


@contextlib.contextmanager
def hub(fleet, places):
    """Positions in the field's frame are sent all the time."""
    frame, axis_deg = fleet.frame, fleet.field.y_axis_deg
    fixes = [Fix(boat, *frame.to_geodetic_deg(*place), axis_deg, 0.0, 0.0, 0.1) for boat, place in places.items()]
    with FeedSender("hub", [fleet.feed.referee]) as sender, repeating(lambda: sender.send_positions(fixes)):
        yield


def test_the_command_keeps_a_game_and_runners_hear_how_it_stands(fleet_file, tmp_path):
    fleet = load_fleet(fleet_file)
    with (
        FeedReceiver(fleet.feed.listen, fleet.frame, MonotonicClock(), boats=fleet.names) as runner,
        hub(fleet, {"b1": (33.0, 20.0), "r1": (34.0, 20.0)}),
    ):
        result = CliRunner().invoke(app, ["referee", str(fleet_file), "--json", str(tmp_path / "game.json")])
        heard = runner.game()
    assert result.exit_code == 0, result.output
    assert "the game begins" in result.output
    content = json.loads((tmp_path / "game.json").read_text())
    assert undocumented(content, KEYS["referee"]) == []
    assert (content["ended"], content["game"]["over"]) == ("over", True)
    assert content["events"][0]["text"] == "the game begins"
    assert isinstance(heard, GameState)
    assert heard.over
    assert heard.boats["r1"].tagged, "one blue boat at its side, one red boat beside it"


def test_without_addresses_or_players_there_is_no_referee(fleet_file, fleet_of):
    fleet = load_fleet(fleet_file)
    with Referee(fleet, ManualClock()), pytest.raises(BridgeError, match="cannot hear the feed"):
        Referee(fleet, ManualClock())
    nobody = fleet_of(1).model_copy(update={"boats": (fleet_of(1).boat("rescue"),)})
    with pytest.raises(FleetFileError, match="no boat plays"):
        Referee(nobody, ManualClock())
    assert player_names(fleet_of(1)) == ("blue_1", "red_1")
    assert game_config(fleet_of(1)).n_boats == 2
    with pytest.raises(GameError, match="3 names for 4 boats"):
        Umpire(GameConfig.preset("aamas2024", team_size=2), NAMES[:3])


def test_an_interrupted_referee_says_so(fleet_file):
    fleet, asked = load_fleet(fleet_file), []
    with FeedReceiver(fleet.feed.listen, fleet.frame, MonotonicClock(), boats=fleet.names) as runner:

        def interrupt():
            if runner.game() is not None and not asked:
                asked.append(True)
                os.kill(os.getpid(), signal.SIGINT)

        with hub(fleet, {"b1": (33.0, 20.0), "r1": (60.0, 20.0)}), repeating(interrupt):
            result = CliRunner().invoke(app, ["referee", str(fleet_file)])
    assert result.exit_code == 130
    assert "interrupted" in result.stderr


def test_with_signing_boats_and_referee_sign_what_they_say_and_nobody_else_is_heard(tmp_path):
    key_file, clock = tmp_path / "feed.key", MonotonicClock()
    key_file.write_text("12" * 32)
    key_file.chmod(0o600)
    fleet = parse_fleet(text_of() + f"\nsigning: {{key_file: {key_file}}}")
    strange = Fix("r1", 42.0001, -71.0, 0.0, 0.0, 0.0, 0.0)
    with (
        FeedReceiver(fleet.feed.listen, fleet.frame, clock, boats=fleet.names, key=bytes.fromhex("12" * 32)) as runner,
        Referee(fleet, clock) as referee,
        FeedSender("gps_hub", [fleet.feed.listen, fleet.feed.referee]) as liar,
        SimFleet.from_file(fleet, autopilot=AutopilotSettings(boot_s=0.0)) as boats,
    ):
        wait_for(lambda: liar.send_positions([strange]) or len(referee.contacts()) == 2)
        wait_for(lambda: referee.turn() and runner.game() is not None and len(runner.read()) == 2)
        x_m, y_m = boats.states()["r1"][:2]
        for told in (runner.read(), referee.contacts()):
            found = {contact.boat: contact for contact in told}
            assert found["r1"].position_m == pytest.approx((x_m, y_m), abs=0.5)
        wait_for(lambda: liar.send_positions([strange]) or runner.faults().get("unsigned", 0) > 3)
        assert set(runner.faults()) == {"unsigned"}
        assert runner.alarms() == ()


def test_the_circle_is_the_one_the_simulator_gives_the_shield(fleet_of):
    for team in ("blue", "red"):
        fleet = fleet_of(team=team)
        reader = MctfReader(MctfEnv(game_config(fleet)))
        assert game_obstacles(fleet) == reader.surroundings(fleet.team_number, keep_out=True)


def test_obstacles_of_the_rules_are_there_and_a_file_without_a_game_has_nothing(fleet_of):
    fleet = fleet_of(more="rules: {obstacles: {circle: [[2.0, [40.0, 20.0]]], polygon: [[[50, 5], [55, 5], [52, 9]]]}}")
    fixed = game_obstacles(fleet)
    assert fixed.circles == ((40.0, 20.0, 2.0),)
    assert fixed.polygons == (((50.0, 5.0), (55.0, 5.0), (52.0, 9.0)),)
    alone = parse_fleet(
        """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
boats: [{name: a, team: blue, platform: heron, link: {kind: mavlink, address: "udpin:127.0.0.1:1", system_id: 1}}]
"""
    )
    assert game_obstacles(alone) is OPEN_WATER


def test_rules_that_make_no_game_are_one_clear_error(fleet_of):
    with pytest.raises(FleetFileError, match="flag_keepout"):
        game_obstacles(fleet_of(more="rules: {flag_keepout_m: -1.0}"))
