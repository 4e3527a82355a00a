"""`steerclear preflight` and `deploy` on simulated boats behind real sockets, and what they refuse."""

import contextlib
import json
import socket
import threading
from dataclasses import replace

import pytest
from json_keys import KEYS, undocumented
from steerclear.env.core import BatchedMctf
from steerclear.experiments.cli import app
from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.deploy.orders import (
    Orders,
    Surface,
    check_drill,
    keep,
    measured_delay_s,
    path_of,
    read_fleet,
)
from steerclear.experiments.deploy.plain import Tally
from steerclear.experiments.deploy.proof import prove
from steerclear.experiments.deploy.referee import game_config, game_obstacles, player_names, state_of
from steerclear.experiments.deploy.run import deploy, preflight
from steerclear.experiments.sim_boats import AutopilotSettings, SimFleet
from steerclear.shield.bridge.blackbox import LogReader, log_path
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.control_loop import Timing
from steerclear.shield.bridge.feed_packets import FeedSender
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.messages import BoatReading
from steerclear.shield.bridge.preflight_checks import CheckResult
from steerclear.shield.bridge.session import VehicleSession
from steerclear.shield.exceptions import ConfigError, FleetFileError, LinkError, PolicyError
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms.files import PlatformFile, to_text
from typer.testing import CliRunner
from waiting import repeating

SPEED = 5.0
LIMITS = "{navigation: {max_age_s: 2.0, then: stop, lost_after_s: 5.0}, contact: {max_age_s: 3.0, then: slow}}"


@pytest.fixture
def fleet_file(tmp_path):
    link, feed = free_ports(2)
    text = f"""
version: 1
field: {{origin: {{latitude_deg: 42.0, longitude_deg: -71.0}}, size_m: [80, 40]}}
geofence: {{xmin_m: -10, ymin_m: -10, xmax_m: 90, ymax_m: 50}}
team: blue
boats:
  - name: blue_1
    agent: agent_0
    platform: heron
    link: {{kind: mavlink, address: "udpin:127.0.0.1:{link}", system_id: 1}}
  - {{name: red_1, agent: agent_1, platform: heron, contact: feed}}
feed: {{listen: "127.0.0.1:{feed}"}}
limits: {LIMITS}
"""
    path = tmp_path / "FLEET.yaml"
    path.write_text(text)
    return path


@pytest.fixture
def entry(write_entry):
    return write_entry("return (1.0, 30.0)")


@pytest.fixture
def boats(fleet_file):
    with SimFleet.from_file(
        load_fleet(fleet_file), opponents="", autopilot=AutopilotSettings(boot_s=0.0), speed=SPEED, waits=True
    ) as fleet:
        yield fleet


def orders_of(fleet_file, policy="easy", **settings):
    return Orders(fleet_file, policy, **{"speed": SPEED, "connect_s": 90.0, **settings})


BUSY = ("latency", "rates", "spread", "course", "response")
"""Checks that a busy machine may fail on boats that live five times as fast."""


@contextlib.contextmanager
def referee(fleet):
    """Says all the time that both flags are home."""
    state = state_of(BatchedMctf(game_config(fleet)), player_names(fleet))
    with FeedSender("referee", fleet.feed_listeners()) as sender, repeating(lambda: sender.send_game(state)):
        yield


def test_a_run_on_simulated_boats_from_preflight_to_stopped(fleet_file, boats, entry):
    seen = []
    first = preflight(orders_of(fleet_file, accept=BUSY), Surface(seen.append))
    assert [result.text for result in first.refused] == []
    drilled = {f"{kind}:blue_1" for kind in ("course", "response", "model")}
    assert {"disk", "known", "geofence", "backup", *drilled} <= {r.name for r in seen}
    fleet = load_fleet(fleet_file)
    with referee(fleet):
        outcome = deploy(orders_of(fleet_file, entry, minutes=0.1, accept=BUSY, begun_unix_s=86400.0))
    assert outcome.refused == []
    assert outcome.log == log_path(fleet.log_dir, ".mcap", 86400.0)
    assert outcome.log.with_suffix(".tlog").exists(), "all files of a run have one name"
    assert outcome.ended.startswith("ran for")
    assert outcome.figures["decided"] > 10
    assert "HOLD" in outcome.left[0]
    with LogReader(outcome.log) as log:
        ticks = list(log.ticks())
        proof = prove(log.header, ticks)
    assert proof.same == proof.decisions > 10
    heard = [tick for tick in ticks if tick.game and tick.surroundings is not None]
    assert any(tick.surroundings.stops == game_obstacles(fleet).stops != () for tick in heard), "the own flag is home"
    assert len(ticks) == outcome.figures["ticks"]
    assert any(tick.sent["blue_1"].speed_mps > 0.5 for tick in ticks)
    assert next(tick for tick in ticks if tick.decisions is not None).shield_reset
    assert boats.states()["blue_1"][3] < 0.5


def interrupt(*given):
    raise KeyboardInterrupt


def test_a_run_interrupted_at_once_tells_what_is_known_and_an_earlier_drill_stays_valid(fleet_file, boats, entry):
    outcome = deploy(orders_of(fleet_file, entry, accept=(*BUSY, "drill")), Surface(sinks=interrupt))
    assert outcome.ended == "SIGINT"
    assert "HOLD" in outcome.left[0]
    assert outcome.log.exists()
    assert outcome.missing == ""
    before = path_of(load_fleet(fleet_file), None)
    before.write_text("a drill that passed")
    outcome = preflight(orders_of(fleet_file), Surface(interrupt))
    assert outcome.ended == "SIGINT"
    assert "blue_1" in outcome.left[0]
    assert before.read_text() == "a drill that passed"


def test_boats_whose_stop_nobody_waits_for_any_longer_are_told_as_they_were_last_seen(fleet_file, monkeypatch):
    class Slow:
        boat = "blue_1"
        ends = threading.Event()

        def close(self):
            self.ends.wait(20.0)

        def read(self):
            return BoatReading("blue_1", 0.0, mode="GUIDED", speed_mps=1.23)

    calls = []

    def wait(futures, timeout_s=None):
        calls.append(timeout_s)
        if timeout_s is None:
            raise KeyboardInterrupt

    monkeypatch.setattr("steerclear.shield.bridge.session.wait", wait)
    session = VehicleSession(load_fleet(fleet_file), None, MonotonicClock(), tlog=False)
    session.links = {"blue_1": Slow()}
    with pytest.raises(KeyboardInterrupt):
        session.close()
    Slow.ends.set()
    session.close()
    assert session.left == ("blue_1: told to stop by its link, not verified: last seen in GUIDED, 1.2 m/s",)
    assert 0.0 < calls[1] <= 5.0


def test_deploy_refuses_to_start_without_its_preflight_and_moves_nothing(fleet_file, boats, entry):
    boats.place("blue_1", 20.0, 70.0, 0.0)
    before = boats.states()["blue_1"][:2].copy()
    outcome = deploy(orders_of(fleet_file, entry, minutes=0.1, accept=BUSY))
    assert {"drill", "geofence"} <= {result.name for result in outcome.refused}
    assert outcome.log is None
    assert "left alone" in outcome.left[0]
    assert boats.states()["blue_1"][:2] == pytest.approx(before)


@pytest.fixture
def no_packet(monkeypatch):
    """Fails the test when boats are spoken to."""

    def connect(self, timeout_s=0.0):
        raise RuntimeError("packets were sent")

    monkeypatch.setattr(VehicleSession, "connect", connect)


def taken(path, kind):
    """Take the port of a file's link or feed."""
    fleet = load_fleet(path)
    text = fleet.boats[0].link.address if kind == "link" else fleet.feed.listen
    entry = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    entry.bind(("127.0.0.1", int(text.rpartition(":")[2])))
    return entry


SECOND = """  - {name: blue_2, agent: agent_1, platform: heron, link: {kind: mavlink, address: "ADDRESS", system_id: 1}}
  - {name: red_1, agent: agent_2, platform: heron, contact: feed}
  - {name: red_2, agent: agent_3"""
FENCE, TEAM, FEED = "{xmin_m: -10, ymin_m: -10, xmax_m: 90, ymax_m: 50}", "team: blue", 'feed: {listen: "127.0.0.1:'
UDP = "udpin:127.0.0.1:"
MISTAKES = {
    "unknown key": (TEAM, TEAM + "\ngeofense: {xmin_m: 0}", "did you mean 'geofence'"),
    "two boats with one id": ("  - {name: red_1, agent: agent_1", SECOND, "have one system_id, 1"),
    "no geofence": (f"geofence: {FENCE}\n", "", "geofence is missing"),
    "key file readable by all": (TEAM, TEAM + "\nsigning: {key_file: my.key}", "chmod 600"),
    "unknown rules": (TEAM, TEAM + "\npreset: chess", "chess"),
    "nothing to command": (TEAM, "team: red", "no boat of team red has a link"),
    "no boat named": (TEAM, TEAM + "\ncoordination: per_boat", "--boat"),
    "a feed that is no address": ("listen: ", "listen: x", "HOST:PORT"),
    "no water left": (FENCE, "{xmin_m: 0, ymin_m: 0, xmax_m: 0.3, ymax_m: 50}", "too small"),
    "too narrow": (FENCE, "{xmin_m: 0, ymin_m: 0, xmax_m: 1.5, ymax_m: 50}", "narrower"),
    "error eats the water": (TEAM, TEAM + "\nshield: {position_error_m: 40.0}", "too small"),
    "a rule nobody knows": (TEAM, TEAM + "\nrules: {name: x}", "unknown game setting"),
    "a circle of the rules that is none": (TEAM, TEAM + "\nrules: {circles: [[1, 2]]}", "rules"),
    "log folder is a file": (TEAM, TEAM + "\nlog_dir: FLEET.yaml", "log"),
    "log folder of the system": (TEAM, TEAM + "\nlog_dir: /proc/steerclear", "log"),
    "no key": (TEAM, TEAM + "\nsigning: {key_file: none.key}", "signing key"),
    "no such route": ("system_id: 1}", "system_id: 1, route: TELEPATHY}", "route"),
    "no such host": (UDP, "udpin:no.such.host.invalid:", "no.such.host.invalid"),
    "no such device": (UDP, "serial:/dev/none:", "none"),
    "no such listener": (
        FEED,
        'feed: {publish: ["no.such.host.invalid:9"], listen: "127.0.0.1:',
        "no.such.host.invalid",
    ),
}
"""What is replaced in the file, and what is said."""
ACCEPTED = ("disk", "geofence", "certificate", "known", "drill", "latency", "rates", "spread", "clock", "autopilot")


def one_line_and_exit_2(command, path, *more):
    """What a command says, which is one line; it leaves with status 2. Simulated boats here may say that they lag."""
    result = CliRunner().invoke(app, [command, str(path), *more])
    assert result.exit_code == 2, result.output
    (line,) = (text for text in result.stderr.strip().splitlines() if "simulated boats are" not in text)
    assert line.startswith("error: ")
    assert line.isprintable()
    return line


def mistaken(fleet_file, name):
    """Put a mistake into the file; what is to be said of it."""
    old, new, said = MISTAKES[name]
    text = fleet_file.read_text()
    assert old in text
    address = load_fleet(fleet_file).boats[0].link.address
    fleet_file.write_text(text.replace(old, new.replace("ADDRESS", address), 1))
    (fleet_file.parent / "my.key").write_text("ab" * 32)
    (fleet_file.parent / "my.key").chmod(0o644)
    return said


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_exit_2_before_any_packet(fleet_file, no_packet, name):
    said = mistaken(fleet_file, name)
    accepted = [f"--accept={check}" for check in ACCEPTED]
    opens = name in ("no such route", "no such host", "no such device")
    command = ("preflight", "--wait=1") if opens else ("deploy", "--policy=easy")  # which starts its policy before
    assert said in one_line_and_exit_2(command[0], fleet_file, command[1], *accepted)
    assert not list(fleet_file.parent.rglob("*.mcap")), "nothing was begun"


def test_a_sound_file_gets_as_far_as_packets_and_none_is_said(fleet_file, no_packet):
    with pytest.raises(RuntimeError, match="packets were sent"):
        preflight(orders_of(fleet_file, connect_s=1.0, tlog=False))
    with pytest.raises(ConfigError, match="no such check"):
        preflight(orders_of(fleet_file, accept=("latencies",), tlog=False))
    with taken(fleet_file, "link"), pytest.raises(PolicyError, match="did you mean medium"):
        deploy(orders_of(fleet_file, "mediun"))


def test_a_boat_that_does_not_answer_is_named(fleet_file):
    with pytest.raises(LinkError, match="blue_1"):
        preflight(orders_of(fleet_file, connect_s=0.5))


@pytest.mark.parametrize(("command", "kind"), [("preflight", "link"), ("preflight", "feed"), ("deploy", "feed")])
def test_a_port_that_is_taken_is_one_line_and_exit_2_and_nothing_is_sent(fleet_file, boats, kind, command):
    with taken(fleet_file, kind):
        line = one_line_and_exit_2(command, fleet_file, "--wait", "0.5", "--no-tlog")
    assert "in use" in line
    counts = boats.boats["blue_1"].autopilot.counts
    assert counts["taken"] == counts["ignored"] == counts["refused"] == 0


@pytest.mark.parametrize(
    "content",
    ["[]", "{", "{}", "1", "[" * 5000, '{"checks": [1], "refused": [], "unix_s": 1}', "\u00e9",
     '{"fleet": "", "checks": [{"name": "response:blue_1", "passed": true, "text": "", "figures": {"delay_s": "x"}}], '
     '"refused": [], "unix_s": 1}',
     '{"fleet": "", "checks": [{"name": "response:blue_1", "passed": true, "text": "", "figures": {"delay_s": NaN}}], '
     '"refused": [], "unix_s": 1}',
     '{"fleet": "", "checks": [], "refused": [[]], "unix_s": 1}',
     '{"fleet": "", "checks": [], "refused": [], "unix_s": "now"}'],
)  # fmt: skip
def test_a_kept_preflight_of_a_wrong_form_counts_as_missing(fleet_file, content):
    fleet = load_fleet(fleet_file)
    path_of(fleet, None).parent.mkdir()
    path_of(fleet, None).write_text(content)
    assert measured_delay_s(fleet, None) is None
    assert "no preflight" in check_drill(fleet, fleet_file.read_text(), None, ["blue_1"]).text


def test_every_key_of_the_json_is_documented(fleet_file, boats, tmp_path):
    path = tmp_path / "out.json"
    options = [*(f"--accept={name}" for name in (*BUSY, "drill", "known")), "--speed", f"{SPEED:g}", "--wait", "90"]
    drilled, fleet = [good("course"), good("response"), good("model")], load_fleet(fleet_file)
    keep(fleet, fleet_file.read_text(), None, drilled, [])
    result = CliRunner().invoke(app, ["preflight", str(fleet_file), "--no-drill", "--json", str(path), *options])
    assert result.exit_code == 0, result.output
    content = json.loads(path.read_text())
    assert check_drill(fleet, fleet_file.read_text(), None, ["blue_1"]).passed, "checks alone leave it in force"
    assert {"disk", "geofence", "rates:blue_1"} <= {check["name"] for check in content["checks"]}
    assert undocumented(content, KEYS["preflight"]) == []
    figures = {**Timing().figures(), **Tally().figures(), "missed_turns": 0.0}
    assert undocumented({"figures": figures}, KEYS["deploy"]) == []


def good(kind, passed=True, **figures):
    return CheckResult(f"{kind}:blue_1", passed, "as heron" if passed else "it turns slower", figures)


def test_a_drill_counts_for_the_same_file_for_a_while_and_when_it_passed(fleet_file, monkeypatch):
    fleet, text = load_fleet(fleet_file), fleet_file.read_text()

    def check(file_text=text):
        return check_drill(fleet, file_text, None, ["blue_1"])

    assert "no preflight" in check().text
    keep(fleet, text, None, [good("course"), good("response", delay_s=0.23), good("model")], [])
    assert check().passed
    assert measured_delay_s(fleet, None) == 0.23
    measured = read_fleet(orders_of(fleet_file))[0]
    assert measured.shield_config.delay_s == 0.23
    counted = "boats drilled 0 min ago; a delay of 0.23 s is counted as 0.3 s, in whole turns of the loop"
    assert check_drill(measured, text, None, ["blue_1"]).text == counted
    assert "changed" in check(text + "\n").text
    keep(fleet, text, None, [good("course"), good("response", False), good("model")], ["response:blue_1"])
    assert "turns slower" in check().text
    keep(fleet, text, None, [good("course"), good("response", False), good("model")], [])
    assert check().passed, "it was accepted at the preflight"
    keep(fleet, text, None, [good("course"), good("model")], [])
    assert "lacks response:blue_1" in check().text
    monkeypatch.setattr("time.time", lambda: 4e9)
    assert "h old" in check().text
    path_of(fleet, None).write_text("{")
    assert "no preflight" in check().text


def test_a_new_fit_under_the_same_name_asks_for_a_new_drill(fleet_file):
    model, first = fleet_file.parent / "mine.yaml", replace(get_platform("heron"), name="mine")
    model.write_text(to_text(PlatformFile(first)))
    text = fleet_file.read_text().replace("platform: heron\n", "platform: mine.yaml\n")
    fleet_file.write_text(text)
    keep(load_fleet(fleet_file), text, None, [good("course"), good("response"), good("model")], [])
    assert check_drill(load_fleet(fleet_file), text, None, ["blue_1"]).passed
    for fitted in (PlatformFile(replace(first, max_speed_mps=1.9)), PlatformFile(first, {"delay_s": 0.4})):
        model.write_text(to_text(fitted))
        assert "platform file" in check_drill(load_fleet(fleet_file), text, None, ["blue_1"]).text


def test_without_a_drill_a_step_of_delay_is_assumed_and_a_declared_one_is_kept(fleet_file):
    assert read_fleet(orders_of(fleet_file))[0].shield_config.delay_s == pytest.approx(0.1)
    assert read_fleet(orders_of(fleet_file, unknown_delay_s=0.0))[0].shield_config.delay_s == 0.0, "a demonstration"
    fleet_file.write_text(fleet_file.read_text() + "\nshield: {delay_s: 0.4}\n")
    assert read_fleet(orders_of(fleet_file))[0].shield_config.delay_s == 0.4
    assert read_fleet(orders_of(fleet_file, unknown_delay_s=0.0))[0].shield_config.delay_s == 0.4


def test_a_file_with_nothing_to_command_says_why(fleet_file):
    text = fleet_file.read_text().replace("agent: agent_0\n", "\n").replace("agent: agent_1, ", "")
    fleet_file.write_text(text)
    with pytest.raises(FleetFileError, match="'blue_1' has a link and neither agent nor team: nobody here steers it"):
        read_fleet(orders_of(fleet_file))
    fleet_file.write_text(text.replace("name: blue_1\n", "name: blue_1\n    commanded: false\n"))
    with pytest.raises(FleetFileError, match="no boat of team blue has a link"):
        read_fleet(orders_of(fleet_file))
