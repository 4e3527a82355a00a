import json
import re
import socket

import pytest
from json_keys import KEYS, undocumented
from steerclear.env.record import load
from steerclear.experiments.cli import app
from steerclear.experiments.sim_boats import SimFleet
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.experiments.sim_boats.faults import Incident, parse_incident
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.exceptions import ConfigError
from typer.testing import CliRunner

runner = CliRunner()


def free_ports(count):
    probes = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    try:
        for probe in probes:
            probe.bind(("127.0.0.1", 0))
        return [probe.getsockname()[1] for probe in probes]
    finally:
        for probe in probes:
            probe.close()


@pytest.fixture
def fleet_path(tmp_path):
    """The demo fleet on free ports."""
    text = demo_text()
    wanted = sorted(set(re.findall(r"127\.0\.0\.1:(\d+)", text)))
    for old, new in zip(wanted, free_ports(len(wanted)), strict=True):
        text = text.replace(f":{old}", f":{new}")
    path = tmp_path / "fleet.yaml"
    path.write_text(text)
    return path


def test_a_fleet_from_its_file(fleet_path, tmp_path):
    key = tmp_path / "boats.key"
    key.write_text("ab" * 32)
    key.chmod(0o600)
    text = fleet_path.read_text() + f"signing: {{key_file: {key}}}\n"
    fleet = SimFleet.from_file(parse_fleet(text), opponents="rammer")
    try:
        assert list(fleet.addresses) == ["blue_1", "blue_2", "blue_3"]
        assert fleet.system_ids["blue_3"] == 3
        assert {fleet.boats[name].spec.policy for name in ("red_1", "red_2", "red_3")} == {"rammer"}
        assert fleet.boats["blue_1"].autopilot._codec.signs
        assert fleet.frame == parse_fleet(text).frame
    finally:
        fleet.close()


def test_runs_and_writes_figures_and_record(fleet_path, tmp_path):
    figures, record = tmp_path / "run.json", tmp_path / "truth.npz"
    options = ["--no-wait", "--duration", "4", "--speed", "20", "--wind", "5@270", "--noise", "1", "--loss", "0.1"]
    faults = ["--fault", "blue_1:restart@1", "--fault", "red_1:jump@1+2,distance_m=10"]
    files = ["--record", str(record), "--json", str(figures)]
    result = runner.invoke(app, ["sim-boats", str(fleet_path), *options, *faults, *files])
    assert result.exit_code == 0, result.output
    content = json.loads(figures.read_text())
    assert undocumented(content, KEYS["sim-boats"]) == []
    assert content["simulated_s"] >= 4.0
    assert content["played"]
    assert len(content["closest"]) == 15
    assert len(load(record)["wanted"]) >= 35
    assert "blue_1: restart" in result.output
    assert "driven by" in result.output


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "--demo"),
        (["nowhere.yaml"], "cannot read"),
        (["nowhere.yaml", "--demo"], "--demo"),
        (["FLEET", "--wind", "strong"], "--wind"),
        (["FLEET", "--noise", "-1"], "noise"),
        (["FLEET", "--loss", "2"], "loss"),
        (["FLEET", "--speed", "0"], "speed"),
        (["FLEET", "--opponents", "nobody"], "nobody"),
        (["FLEET", "--fault", "blue_1:explode@3"], "explode"),
        (["FLEET", "--fault", "blue_9:jump@3"], "blue_9"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(fleet_path, options, says):
    given = [str(fleet_path) if option == "FLEET" else option for option in options]
    result = runner.invoke(app, ["sim-boats", *given, "--duration", "0.1"])
    assert result.exit_code == 2
    line = result.output.strip().splitlines()[-1]
    assert line.startswith("error: ")
    assert says in line


def test_planned_faults_are_read():
    assert parse_incident("blue_1:jump@60+10,distance_m=5,course_deg=0") == Incident(
        "blue_1", "jump", 60.0, 10.0, {"distance_m": 5, "course_deg": 0}
    )
    assert parse_incident("b:late@2").lasts_s == float("inf")
    for wrong in ("jump@60", "b:jump", "b:jump@x", "b:jump@1,a=x y", "b:jump@1.2.3", ""):
        with pytest.raises(ConfigError):
            parse_incident(wrong)


def test_boats_the_runner_does_not_command_are_driven_and_safety_boats_lie_beside(fleet_path):
    link = '{kind: mavlink, address: "udpout:127.0.0.1:%d", system_id: %d}'
    ports = free_ports(2)
    text = fleet_path.read_text()
    text = text.replace(
        "red_1, agent: agent_3, platform: heron, contact: feed}",
        f"red_1, agent: agent_3, platform: heron, commanded: false, link: {link % (ports[0], 11)}}}",
    )
    text = text.replace(
        "feed: {listen",
        f"  - {{name: safety, platform: heron, commanded: false, link: {link % (ports[1], 12)}}}\nfeed: {{listen",
    )
    fleet = SimFleet.from_file(parse_fleet(text), opponents="rammer")
    try:
        assert fleet.boats["red_1"].spec.policy == "rammer"
        assert "red_1" in fleet.addresses
        assert fleet.boats["safety"].spec.policy == ""
        assert tuple(fleet.states()["safety"][:2]) == (33.0, -3.0)
        fleet.advance(1.0)
    finally:
        fleet.close()
