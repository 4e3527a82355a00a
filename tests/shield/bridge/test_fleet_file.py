"""A bad FLEET.yaml is one clear line that names the remedy; a good one says all that follows from it."""

import math
import pickle

import pytest
from bridge_fakes import fleet_of, fleet_text
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet
from steerclear.shield.exceptions import FleetFileError
from steerclear.shield.platforms import Platform

GOOD = fleet_text(blue=2, red=2)


def test_a_good_file_says_what_follows():
    fleet = parse_fleet(GOOD)
    assert fleet.names == ("blue_1", "blue_2", "red_1", "red_2")
    assert fleet.team_of == {"blue_1": 0, "blue_2": 0, "red_1": 1, "red_2": 1}
    assert [boat.name for boat in fleet.commanded()] == ["blue_1", "blue_2"]
    assert fleet.dt_s == pytest.approx(0.1)
    assert fleet.surroundings.field == (-20.0, -20.0, 100.0, 60.0)
    assert fleet.frame.latitude_deg == 42.0
    assert fleet.kind_of["red_1"] == "heron"
    assert fleet.feed_listeners() == ("127.0.0.1:14700",)
    assert fleet.limits.contact.lost_after_s == 5.0
    assert fleet.shield_config.max_track_age_s > 5.0
    assert pickle.loads(pickle.dumps(fleet)) == fleet


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("platform: heron, link", "platfrom: heron, link", "did you mean 'platform'"),
        ("platform: heron, contact", "contact", "boats[2].platform is missing"),
        ("geofence:", "# geofence:", "geofence is missing; give xmin_m"),
        ("agent_1", "agent_0", "two boats play 'agent_0'"),
        ("blue_2", "blue_1", "two boats are named 'blue_1'"),
        ("system_id: 2", "system_id: 1", "have one system_id, 1"),
        ("system_id: 2", "system_id: 256", "1 to 255"),
        ("agent_3", "agent_7", "give an even number"),
        ("size_m: [80, 40]", "size_m: [80]", "size_m[1] is missing"),
        ("size_m: [80, 40]", "size_m: [80, -1]", "greater than 0; give [length"),
        ("xmax_m: 100", "xmax_m: -100", "is empty"),
        ("latitude_deg: 42.0", "latitude_deg: 420", "latitude"),
        ("version: 1", "version: 2", "version 2 is newer than this steerclear reads (1); update it"),
        ("version: 1", "version: 0", "version is 0: it should be greater than or equal to 1; give the version"),
        ("system_id: 2", "system_id: 999", "system_id is 999: it should be less than or equal to 255; give"),
        ("name: blue_2", "name: blue 2", "boats[1].name is 'blue 2'; give 1 to 32 letters"),
        ("team: blue", "team: green", "blue or red"),
        ("heron", "heroon", "unknown platform 'heroon'"),
        ("udpin:127.0.0.1:14550", "udp:127.0.0.1:14550", "give one of udpin"),
        ("udpin:127.0.0.1:14550", "udpin:127.0.0.1:99999", "HOST:PORT"),
        ("14700", "14550", "use one port, 14550"),
        ("127.0.0.1:14700", "14700", "HOST:PORT"),
        ("contact: feed", "contact: telemetry", "nobody says where"),
        ("team: blue", "team: blue\nteam: red", "given twice"),
        ("team: blue", "team: blue\nrate_hz: .nan", "rate_hz"),
        ("team: blue", "team: blue\nshield: {dellay_s: 1}", "did you mean 'delay_s'"),
        ("team: blue", "team: blue\nshield: {dt_s: 0.5}", "leave shield.dt_s out"),
        ("team: blue", "team: blue\nshield: {barriers: ferry}", "shield.barriers: what they are given is not in"),
        ("team: blue", "team: blue\nshield: {coordination: per_boat}", "leave shield.coordination out"),
        ("team: blue", "team: blue\nshield: {max_track_age_s: 1.0}", "leave shield.max_track_age_s out"),
        ("team: blue", "team: blue\nlimits: {policy: {then: jump}}", "hold_course"),
        ("team: blue", "team: blue\nlimits: {contact: {max_age_s: 9.0}}", "before max_age_s"),
        ("team: blue", "team: blue\nlimits: {navigation: {max_age: 9.0}}", "did you mean 'max_age_s'"),
        ("team: blue", "team: blue\nlogdir: x", "did you mean 'log_dir'"),
        ("team: blue", "team: blue\nplatforms: {mine: {max_speed: 2}}", "platforms.mine"),
        ("team: blue", "team: blue\nplatforms: {mine: {max_speed_mps: -2}}", "platforms.mine"),
        (
            "team: blue\n",
            "team: blue\nplatforms: {mine: {max_speed_mps: 3.0}}\n",
            "platforms.mine: platform 'mine' is no boat that can be steered",
        ),
        ("agent: agent_0,", "agent: agent_0, team: red,", "leave its team out"),
        ("contact: feed", "contact: feed, feed_listen: '127.0.0.1:1'", "leave its feed_listen out"),
    ],
)
def test_what_is_wrong_is_said_in_one_line_with_the_remedy(old, new, said):
    text = GOOD.replace(old, new)
    assert text != GOOD
    with pytest.raises(FleetFileError) as caught:
        parse_fleet(text, "boats.yaml")
    assert said in str(caught.value)
    assert str(caught.value).startswith("boats.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "[]", "a: [", "just words", "a: *b", "\x00", "!!python/object:os.system {}"])
def test_what_is_no_settings_is_said(text):
    with pytest.raises(FleetFileError, match=r"no settings|not YAML"):
        parse_fleet(text)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.data())
def test_no_damage_to_the_text_raises_anything_else(data):
    start = data.draw(st.integers(0, len(GOOD) - 1))
    length = data.draw(st.integers(0, 12))
    put = data.draw(st.text(st.characters(codec="ascii"), max_size=6))
    said = ""
    try:
        parse_fleet(GOOD[:start] + put + GOOD[start + length :])
    except FleetFileError as error:
        said = str(error)
    assert "\n" not in said


def test_paths_start_from_the_files_folder(tmp_path):
    path = tmp_path / "FLEET.yaml"
    path.write_text(GOOD + "\nsigning: {key_file: my.key}\nlog_dir: there\n")
    fleet = load_fleet(path)
    assert fleet.log_dir == tmp_path / "there"
    assert fleet.signing.key_file == tmp_path / "my.key"
    with pytest.raises(FleetFileError, match="cannot read"):
        load_fleet(tmp_path / "none.yaml")


def test_a_process_per_boat_names_its_boat():
    text = fleet_text(blue=2, red=2, more="coordination: per_boat").replace(
        "system_id: 2}", "system_id: 2}, feed_listen: '127.0.0.1:14702'"
    )
    fleet = parse_fleet(text)
    assert [boat.name for boat in fleet.commanded("blue_2")] == ["blue_2"]
    assert fleet.shield_config.coordination == "per_boat"
    assert fleet.feed_listen("blue_2") == "127.0.0.1:14702"
    assert fleet.feed_listeners() == ("127.0.0.1:14700", "127.0.0.1:14702")
    with pytest.raises(FleetFileError, match="--boat"):
        fleet.commanded()
    with pytest.raises(FleetFileError, match="not ours"):
        fleet.commanded("red_1")
    with pytest.raises(FleetFileError, match="no boat is named 'green'"):
        fleet.commanded("green")


def test_boats_of_somebody_else_are_not_commanded():
    fleet = parse_fleet(GOOD.replace("system_id: 2}", "system_id: 2}, commanded: false"))
    assert [boat.name for boat in fleet.commanded()] == ["blue_1"]
    assert fleet.contact_of(fleet.boat("blue_2")) == "feed"


def test_a_platform_of_the_file_is_used():
    boat = "thrust_map: [[0, 0], [100, 1.5]], turn_gain: 60, speed_pid: {kp: 1.0}, heading_pid: {kp: 0.9}"
    more = f"platforms: {{mine: {{max_speed_mps: 1.5, max_acc: 0.5, {boat}}}}}"
    fleet = fleet_of(blue=1, red=0, platform="mine", more=more)
    assert isinstance(fleet.kind_of["blue_1"], Platform)
    assert fleet.platform_of["blue_1"].max_speed_mps == 1.5


def test_a_measured_delay_replaces_the_declared_one():
    fleet = fleet_of()
    assert fleet.shield_config.delay_s == 0.0
    later = fleet.with_shield(delay_s=0.3)
    assert (later.shield_config.delay_s, fleet.shield_config.delay_s) == (0.3, 0.0)
    with pytest.raises(FleetFileError, match="delay_s"):
        fleet.with_shield(delay_s=math.nan)


def test_the_fence_holds_what_is_inside():
    fence = fleet_of().geofence
    assert fence.holds(0.0, 0.0)
    assert not fence.holds(101.0, 0.0)
    assert not fence.holds(math.nan, 0.0)


def test_on_the_water_margins_from_team_mates_shrink_as_slowly_as_others():
    assert (
        parse_fleet(GOOD).shield_config.teammate_margin_cap_m
        == ShieldConfig().margin_cap_m
        > ShieldConfig().teammate_margin_cap_m
    )
    for setting, follows in (("teammate_margin_cap_m: 0.5", 0.5), ("margin_cap_m: 1.0", 1.0)):
        told = parse_fleet(GOOD.replace("team: blue", f"team: blue\nshield: {{{setting}}}", 1))
        assert told.shield_config.teammate_margin_cap_m == follows


def test_on_water_opponents_are_taken_for_rammers_unless_the_file_says_otherwise():
    assert parse_fleet(GOOD).shield_config.effective_adversary_horizon_s == math.inf
    for setting, adversary_horizon_s in (
        ("profile: competitive", 12.0),
        ("adversary_horizon_s: 12.0", 12.0),
        ("profile: constant_velocity", 0.0),
    ):
        told = parse_fleet(GOOD.replace("team: blue", f"team: blue\nshield: {{{setting}}}", 1))
        assert told.shield_config.effective_adversary_horizon_s == adversary_horizon_s
