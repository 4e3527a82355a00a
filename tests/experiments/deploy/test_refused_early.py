"""Whatever can be refused is refused before the first packet to a boat: nothing is connected, no boat is armed."""

import json

import pytest
from steerclear.experiments.cli import app
from steerclear.experiments.deploy.orders import Orders
from steerclear.experiments.deploy.preflight_file import measured_delay_s, path_of
from steerclear.experiments.deploy.run import deploy, preflight
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.session import VehicleSession
from steerclear.shield.exceptions import SteerclearError
from test_deploy_run import free_ports
from typer.testing import CliRunner

ACCEPTED = ("disk", "geofence", "certificate", "known", "drill", "latency", "rates", "spread", "clock", "autopilot")


@pytest.fixture
def write(tmp_path):
    """Writes a fleet file with parts replaced; answers its path."""

    def build(old="", new="", more=""):
        link, feed = free_ports(2)
        text = f"""
version: 1
field: {{origin: {{latitude_deg: 42.0, longitude_deg: -71.0}}, size_m: [80, 40]}}
geofence: {{xmin_m: -10, ymin_m: -10, xmax_m: 90, ymax_m: 50}}
team: blue
boats:
  - {{name: blue_1, agent: agent_0, platform: heron, link: {{kind: mavlink, address: "udpin:127.0.0.1:{link}",
     system_id: 1}}}}
  - {{name: red_1, agent: agent_1, platform: heron, contact: feed}}
feed: {{listen: "127.0.0.1:{feed}"}}
{more}
"""
        assert old in text
        path = tmp_path / "FLEET.yaml"
        path.write_text(text.replace(old, new))
        return path

    return build


@pytest.fixture(autouse=True)
def no_packet(monkeypatch):
    """Fails the test when boats are spoken to."""

    def connect(self, timeout_s=0.0):
        raise RuntimeError("packets were sent")

    monkeypatch.setattr(VehicleSession, "connect", connect)


FENCE = "{xmin_m: -10, ymin_m: -10, xmax_m: 90, ymax_m: 50}"
MISTAKES = {
    "no water left": ((FENCE, "{xmin_m: 0, ymin_m: 0, xmax_m: 0.3, ymax_m: 50}"), "too small"),
    "too narrow": ((FENCE, "{xmin_m: 0, ymin_m: 0, xmax_m: 1.5, ymax_m: 50}"), "narrower"),
    "error eats the water": (("", "", "shield: {position_error_m: 40.0}"), "too small"),
    "current eats the water": (("", "", "shield: {current_mps: 9.0, delay_s: 5.0}"), "too small"),
    "no such rules": (("", "", "preset: mctf1999"), "unknown preset"),
    "a rule nobody knows": (("", "", "rules: {name: x}"), "unknown game setting"),
    "a rule of another kind": (("", "", "rules: {catch_radius_m: far}"), "catch_radius_m"),
    "a circle of the rules that is none": (("", "", "rules: {circles: [[1, 2]]}"), "rules"),
    "log folder is a file": (("", "", "log_dir: FLEET.yaml"), "log"),
    "log folder in a file": (("", "", "log_dir: FLEET.yaml/logs"), "log"),
    "log folder of the system": (("", "", "log_dir: /proc/steerclear"), "log"),
    "log folder with too long a name": (("", "", f"log_dir: {'a' * 300}"), "log"),
    "no key": (("", "", "signing: {key_file: none.key}"), "signing key"),
    "a key that is a folder": (("", "", "signing: {key_file: .}"), "signing key"),
    "no such route": (("system_id: 1}", "system_id: 1, route: TELEPATHY}"), "route"),
    "no such host": (("udpin:127.0.0.1:", "udpin:no.such.host.invalid:"), "no.such.host.invalid"),
    "no such device": (("udpin:127.0.0.1:", "serial:/dev/none:"), "none"),
}  # fmt: skip


@pytest.mark.parametrize("run", [deploy, preflight], ids=["deploy", "preflight"])
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_in_the_file_is_refused_though_all_checks_are_accepted(write, name, run):
    change, said = MISTAKES[name]
    with pytest.raises(SteerclearError, match=said) as caught:
        run(Orders(write(*change), "easy", accept=ACCEPTED, connect_s=1.0))
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("run", [deploy, preflight], ids=["deploy", "preflight"])
def test_a_check_that_is_none_is_refused(write, run):
    with pytest.raises(SteerclearError, match="patience"):
        run(Orders(write(), "easy", accept=("patience",), connect_s=1.0))


def test_a_policy_that_is_none_and_a_listener_that_is_none_are_refused(write):
    with pytest.raises(SteerclearError, match="no_such"):
        deploy(Orders(write(), "no_such", connect_s=1.0))
    path = write('feed: {listen: "127.0.0.1:', 'feed: {publish: ["no.such.host.invalid:9"], listen: "127.0.0.1:')
    with pytest.raises(SteerclearError, match=r"no\.such\.host\.invalid"):
        deploy(Orders(path, "easy", connect_s=1.0))


def test_a_sound_file_gets_as_far_as_packets(write):
    with pytest.raises(RuntimeError, match="packets were sent"):
        deploy(Orders(write(), "easy", connect_s=1.0))


@pytest.mark.parametrize(
    "content",
    ["[]", "{", "{}", "1", "[" * 5000, '{"checks": [1], "refused": [], "unix_s": 1}', "\u00e9",
     '{"checks": [{"name": "response:blue_1", "text": "", "figures": {"delay_s": "x"}}], "refused": [], "unix_s": 1}',
     '{"checks": [], "refused": [[]], "unix_s": 1}', '{"checks": [], "refused": [], "unix_s": "now"}'],
)  # fmt: skip
def test_a_kept_preflight_of_a_wrong_form_counts_as_missing(write, content):
    fleet = load_fleet(write())
    path_of(fleet, None).parent.mkdir()
    path_of(fleet, None).write_text(content)
    assert measured_delay_s(fleet, None) is None
    path_of(fleet, None).write_text(json.dumps({"checks": [], "refused": [], "unix_s": 1.0}))
    assert measured_delay_s(fleet, None) is None


@pytest.mark.parametrize("command", [["deploy", "--plain"], ["preflight"]], ids=["deploy", "preflight"])
@pytest.mark.parametrize("name", ["log folder is a file", "log folder of the system", "too narrow", "no such rules"])
def test_on_the_command_line_a_mistake_is_one_line_and_2(write, name, command):
    path = write(*MISTAKES[name][0])
    result = CliRunner().invoke(app, [command[0], str(path), *command[1:]])
    assert result.exit_code == 2, result.output
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
