"""A FLEET.yaml means one thing: a good one says all that follows, a bad one is one clear line, at once."""

import math
import os
import pickle
import resource
import time

import pytest
from bridge_fakes import fleet_of, fleet_text
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.fleet_checks import address_of
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet
from steerclear.shield.bridge.fleet_yaml import LONGEST_TEXT, MOST_BYTES, read_settings
from steerclear.shield.exceptions import FleetFileError
from steerclear.shield.platforms import Platform

GOOD = fleet_text(blue=2, red=2)


def test_a_good_file_says_what_follows():
    fleet = parse_fleet(GOOD)
    assert fleet.names == ("blue_1", "blue_2", "red_1", "red_2")
    assert fleet.team_of == {"blue_1": 0, "blue_2": 0, "red_1": 1, "red_2": 1}
    assert [boat.name for boat in fleet.commanded()] == ["blue_1", "blue_2"]
    assert fleet.dt_s == pytest.approx(0.1)
    assert fleet.surroundings.field == fleet.geofence.box == (-20.0, -20.0, 100.0, 60.0)
    assert [fleet.geofence.holds(x, 0.0) for x in (0.0, 101.0, math.nan)] == [True, False, False]
    assert fleet.frame.latitude_deg == 42.0
    assert fleet.kind_of["red_1"] == "heron"
    assert fleet.feed_listeners() == ("127.0.0.1:14700",)
    assert fleet.limits.contact.lost_after_s == 5.0
    assert fleet.shield_config.max_track_age_s > 5.0
    assert pickle.loads(pickle.dumps(fleet)) == fleet
    assert parse_fleet(demo_text()).rate_hz == 10.0, "the file that comes with the package"


LISTEN, LINK = '"127.0.0.1:14700"', '"udpin:127.0.0.1:14550"'
WRONG = [
    ("platform: heron, link", "platfrom: heron, link", "did you mean 'platform'"),
    ("platform: heron, contact", "contact", "boats[2].platform is missing"),
    ("geofence:", "# geofence:", "geofence is missing; give xmin_m"),
    ("agent_1", "agent_0", "two boats play 'agent_0'"),
    ("blue_2", "blue_1", "two boats are named 'blue_1'"),
    ("system_id: 2", "system_id: 1", "have one system_id, 1"),
    ("system_id: 2", "system_id: 256", "system_id is 256: it should be less than or equal to 254; give"),
    ("system_id: 2", "system_id: 255", "give the autopilot's MAVLink system id, 1 to 254: 255 is ours"),
    ("agent_3", "agent_7", "give an even number"),
    ("size_m: [80, 40]", "size_m: [80]", "size_m[1] is missing"),
    ("size_m: [80, 40]", "size_m: [80, -1]", "greater than 0; give [length"),
    ("xmax_m: 100", "xmax_m: -100", "is empty"),
    ("latitude_deg: 42.0", "latitude_deg: 420", "latitude"),
    ("version: 1", "version: 2", "version 2 is newer than this steerclear reads (1); update it"),
    ("version: 1", "version: 0", "version is 0: it should be greater than or equal to 1; give the version"),
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
    ("team: blue", "team: blue\nrate_hz: .inf", "rate_hz"),
    ("team: blue", "team: blue\nshield: {dellay_s: 1}", "did you mean 'delay_s'"),
    ("team: blue", "team: blue\nshield: {dt_s: 0.5}", "leave shield.dt_s out"),
    (
        "team: blue",
        "team: blue\nshield: {current_mps: 2.0}",
        "and boat 'blue_1' (heron) makes 2 m/s",
    ),
    ("version: 1", "max_speed_mps: 3.0\nversion: 1", "is a platform file, of one boat; give a FLEET.yaml"),
    ("team: blue", "team: blue\nshield: {barriers: ferry}", "shield.barriers: what they are given is not in"),
    ("team: blue", "team: blue\nshield: {coordination: per_boat}", "leave shield.coordination out"),
    ("team: blue", "team: blue\nshield: {max_track_age_s: 1.0}", "leave shield.max_track_age_s out"),
    ("team: blue", "team: blue\nlimits: {policy: {then: jump}}", "hold_course"),
    ("team: blue", "team: blue\nlimits: {contact: {max_age_s: 9.0}}", "before max_age_s"),
    ("team: blue", "team: blue\nlimits: {navigation: {max_age: 9.0}}", "did you mean 'max_age_s'"),
    ("team: blue", "team: blue\nlogdir: x", "did you mean 'log_dir'"),
    ("team: blue", "team: blue\nplatforms: {mine: {max_speed: 2}}", "platforms.mine"),
    ("team: blue", "team: blue\nplatforms: {mine: {max_speed_mps: -2}}", "platforms.mine"),
    ("team: blue", "team: blue\nplatforms: {mine: {max_speed_mps: 3.0}}", "'mine' is no boat that can be steered"),
    ("agent: agent_0,", "agent: agent_0, team: red,", "leave its team out"),
    ("contact: feed", "contact: feed, feed_listen: '127.0.0.1:1'", "leave its feed_listen out"),
    # nothing is taken for something else
    ("system_id: 1}", "system_id: true}", "boats[0].link.system_id"),
    ("system_id: 1}", 'system_id: "1"}', "boats[0].link.system_id"),
    ("system_id: 1}", "system_id: ²}", "boats[0].link.system_id"),
    ("version: 1", "version: true", "version"),
    ("latitude_deg: 42.0", "latitude_deg: '42.0'", "latitude_deg"),
    ("size_m: [80, 40]", "size_m: [80, true]", "size_m[1]"),
    ("size_m: [80, 40]", "size_m: 8040", "size_m"),
    ("name: blue_1", "name: 7", "boats[0].name"),
    ("name: blue_1", "name: null", "boats[0].name"),
    ("platform: heron", "platform: 3", "platform"),
    ("team: blue", "team: true", "team"),
    ("team: blue", "team: blue\nlog_dir: 5", "log_dir"),
    ("contact: feed", "contact: feed, commanded: 1", "commanded"),
    (LISTEN, '"127.0.0.1:٣٣"', "feed.listen"),
    (LISTEN, '"a b:14700"', "feed.listen"),
    (LISTEN, '"127.0.0.010:14700"', "feed.listen"),
    (LISTEN, '"0x7f000001:14700"', "feed.listen"),
    (LISTEN, '"127.1:14700"', "feed.listen"),
    (LISTEN, '"[::1:14700"', "feed.listen"),
    (LISTEN, '"[::zz]:14700"', "feed.listen"),
    (LISTEN, f'"{"a" * 70}:14700"', "feed.listen"),
    (LINK, '"udpin:127.0.0.1:²"', "blue_1"),
    (LINK, '"serial:/dev/ttyUSB0:²"', "serial:DEVICE:BAUD"),
    (LINK, '"serial::9600"', "serial:DEVICE:BAUD"),
    (LINK, '"udpin:127.0.0.1:0"', "ends in 0; give its port"),
    ("agent_0", "agent_٣", "agent"),
]


@pytest.mark.parametrize(("old", "new", "said"), WRONG)
def test_what_is_wrong_is_said_in_one_line_with_the_remedy(old, new, said):
    text = GOOD.replace(old, new)
    assert text != GOOD
    with pytest.raises(FleetFileError) as caught:
        parse_fleet(text, "boats.yaml")
    assert said in str(caught.value)
    assert str(caught.value).startswith("boats.yaml")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "team: blue",
            "team: blue\nobstacles: [{polygon_m: [[0, 0], [1, 1]]}]",
            "it has 2 entries, fewer than 3; give",
        ),
        ("xmax_m: 100", "xmax_m: 100 m", "'100 m': it should be a number alone, without a unit or quotes; give metres"),
        (
            "team: blue",
            "team: blue\nlimits: [1]",
            "limits is [1]: it should be a mapping (key: value), no list or text",
        ),
        ("size_m: [80, 40]", "size_m: 80", "it should be a list ([..., ...]); give [length along x"),
        ("team: blue", "team: blue\nshield: {current_mps: 1 kn}", "give a number in m/s, without the unit"),
    ],
)
def test_values_of_another_kind_are_told_in_words_of_the_file(old, new, said):
    with pytest.raises(FleetFileError) as caught:
        parse_fleet(GOOD.replace(old, new))
    assert said in str(caught.value)
    assert "validation" not in str(caught.value)


def test_a_list_and_a_file_that_is_not_utf_8_are_named(tmp_path):
    with pytest.raises(FleetFileError, match="holds a list in place of settings; give version"):
        parse_fleet("- version: 1\n")
    path = tmp_path / "FLEET.yaml"
    path.write_text(GOOD, encoding="utf-16")
    with pytest.raises(FleetFileError, match=r"cannot read .* \(it is no UTF-8; UTF-16\?\); save it as UTF-8"):
        load_fleet(path)


@pytest.mark.parametrize("text", ["", "a: [", "just words", "a: *b", "\x00", "!!python/object:os.system {}"])
def test_what_is_no_settings_is_said(text):
    with pytest.raises(FleetFileError, match=r"no settings|not YAML"):
        parse_fleet(text)


def test_paths_start_from_the_files_folder(tmp_path):
    path = tmp_path / "FLEET.yaml"
    path.write_text(GOOD + "\nsigning: {key_file: my.key}\nlog_dir: there\n")
    fleet = load_fleet(path)
    assert fleet.log_dir == tmp_path / "there"
    assert fleet.signing.key_file == tmp_path / "my.key"


def test_a_process_per_boat_names_its_boat():
    text = fleet_text(blue=2, red=2, more="coordination: per_boat").replace(
        "system_id: 2}", "system_id: 2}, feed_listen: '127.0.0.1:14702'"
    )
    fleet = parse_fleet(text)
    assert [boat.name for boat in fleet.commanded("blue_2")] == ["blue_2"]
    assert fleet.shield_config.coordination == "per_boat"
    assert fleet.feed_listen("blue_2") == "127.0.0.1:14702"
    assert fleet.feed_listeners() == ("127.0.0.1:14700", "127.0.0.1:14702")
    for boat, words in ((None, "--boat"), ("red_1", "not ours"), ("green", "no boat is named 'green'")):
        with pytest.raises(FleetFileError, match=words):
            fleet.commanded(boat)


def test_boats_of_somebody_else_are_not_commanded():
    fleet = parse_fleet(GOOD.replace("system_id: 2}", "system_id: 2}, commanded: false"))
    assert [boat.name for boat in fleet.commanded()] == ["blue_1"]
    assert fleet.contact_of(fleet.boat("blue_2")) == "feed"


def test_a_boat_with_a_link_that_nobody_steers_says_so_or_is_refused():
    text = fleet_text(blue=2, red=0).replace("name: blue_2, team: blue", "name: blue_2")
    with pytest.raises(FleetFileError, match="'blue_2' has a link and neither agent nor team: nobody here steers it"):
        parse_fleet(text)
    fleet = parse_fleet(text.replace("name: blue_2", "name: blue_2, commanded: false"))
    assert [boat.name for boat in fleet.ours] == ["blue_1"]


def test_a_platform_of_the_file_is_used():
    boat = "thrust_map: [[0, 0], [100, 1.5]], turn_gain: 60, speed_pid: {kp: 1.0}, heading_pid: {kp: 0.9}"
    more = f"platforms: {{mine: {{max_speed_mps: 1.5, max_acc: 0.5, {boat}}}}}"
    fleet = fleet_of(blue=1, red=0, platform="mine", more=more)
    assert isinstance(fleet.kind_of["blue_1"], Platform)
    assert fleet.platform_of["blue_1"].max_speed_mps == 1.5


def test_a_measured_delay_replaces_the_declared_one():
    fleet = fleet_of()
    later = fleet.with_shield(delay_s=0.3)
    assert (later.shield_config.delay_s, fleet.shield_config.delay_s) == (0.3, 0.0)
    with pytest.raises(FleetFileError, match="delay_s"):
        fleet.with_shield(delay_s=math.nan)


@pytest.mark.parametrize(
    ("setting", "name", "value"),
    [
        ("", "effective_adversary_horizon_s", math.inf),  # on water opponents are taken for rammers
        ("profile: competitive", "effective_adversary_horizon_s", 12.0),
        ("adversary_horizon_s: 12.0", "effective_adversary_horizon_s", 12.0),
        ("profile: constant_velocity", "effective_adversary_horizon_s", 0.0),
        ("", "teammate_margin_cap_m", ShieldConfig().margin_cap_m),  # more than in the simulator: hulls are less alike
        ("teammate_margin_cap_m: 0.5", "teammate_margin_cap_m", 0.5),
        ("margin_cap_m: 1.0", "teammate_margin_cap_m", 1.0),
        ("deadlock_timeout_s: .inf", "deadlock_timeout_s", math.inf),
    ],
)
def test_the_shield_on_water_is_the_files_and_else_the_careful_one(setting, name, value):
    assert getattr(parse_fleet(f"{GOOD}\nshield: {{{setting}}}").shield_config, name) == value
    assert ShieldConfig().margin_cap_m > ShieldConfig().teammate_margin_cap_m


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("7", 7), ("-7", -7), ("+7", 7), ("0", 0), ("1.5", 1.5), (".5", 0.5), ("1e3", 1000.0), ("-2.5E-1", -0.25),
        (".inf", math.inf), ("-.INF", -math.inf), ("true", True), ("False", False), ("null", None), ("~", None),
        ("heron", "heron"), ("127.0.0.1", "127.0.0.1"), ("127.0.0.1:14700", "127.0.0.1:14700"), ("'010'", "010"),
        ('"yes"', "yes"), ("²", "²"), ("1,000", "1,000"), ("1.2.3", "1.2.3"), ("0boat", "0boat"),
    ],
)  # fmt: skip
def test_what_all_programs_agree_about_is_read(word, meant):
    assert read_settings(f"a: {word}\nb: [{word.replace(',', '')}]")["a"] == meant
    assert type(read_settings(f"a: {word}")["a"]) is type(meant)


@pytest.mark.parametrize(
    "word",
    [
        "010", "08", "00", "-012", "01.5", "0x1F", "0o17", "0b11", "1_000", "1_0.5", "5:30", "1:0", "12:30:45",
        "1:30.5", "yes", "No", "ON", "off", "2024-01-01", "2024-01-01T10:00:00Z", "2024-01-01 10:00:00", "=", "1e999",
    ],
)  # fmt: skip
def test_what_programs_read_in_several_ways_is_refused_with_the_remedy(word):
    for place in ("a: {}", "- {}", "{}: a", "a: {{b: [1, {}]}}", "a: &x {}"):
        with pytest.raises(FleetFileError, match=r"line 1: .*(write|correct)"):
            read_settings(place.format(word))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &x {b: 1}\nc: {<<: *x}", "line 2: .*merge keys"),
        ("a: !!int 5", "line 1: the tag"),
        ("5: a", "the key 5 is no text"),
        ("null: a", "the key None is no text"),
        ("? [a]\n: b", "is no text"),
        ("{a: 1, a: 2}", "key 'a' is given twice"),
        ("a: {b: 1,\n b: 2}", "line 2: key 'b' is given twice"),
        ("a: 1\n---\nb: 2", "line 2: a second document"),
        ("a: *b", "line 1: no anchor 'b'"),
        ("a:\n\tb: 1", "line 2: .*; indent by spaces, not by tabs"),
        ("a: &b [*b]", "line 1: no anchor 'b' is complete"),
        ('a: "x\\0"', "cannot be seen"),
        ('a: "\\ud800"', "cannot be seen"),
        ('a: "\\u202e"', "cannot be seen"),
        ("a: \x00", "character"),
        ("a: " + "9" * 5000, "5000 characters"),
        ("a: " + "9" * 40, "40 characters; round it"),
        ("a: " + "x" * (LONGEST_TEXT + 1), "at most 1000"),
        ("a: 1\nb: 2 # a comment\x85c: 3\n", "line 2: programs disagree about whether U\\+0085 ends a line"),
        ("a: 1\nb: 2 # a comment\u2028c: 3\n", "line 2: programs disagree about whether U\\+2028 ends a line"),
        (b"version: 1", "it is bytes; give its text"),
    ],
)
def test_what_has_no_place_in_a_fleet_file_is_refused(text, said):
    with pytest.raises(FleetFileError, match=said) as caught:
        read_settings(text)
    assert str(caught.value).isprintable()


def test_a_decimal_comma_is_told_as_one():
    with pytest.raises(FleetFileError, match=r"latitude_deg is '47,6500': a decimal point is wanted, no comma"):
        parse_fleet(fleet_text().replace("latitude_deg: 42.0, ", "latitude_deg: '47,6500', "))


def test_aliases_say_what_their_anchor_said():
    assert read_settings("a: &x {b: [1, 2]}\nc: *x\nd: [*x, *x]")["d"] == [{"b": [1, 2]}] * 2


LARGE = {
    "alias bomb": "a0: &a0 [1]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 40)),
    "131 MB": "1",
    "deep lists": "[" * (MOST_BYTES - 1),
    "deep maps": "{" * (MOST_BYTES - 1),
    "deep dashes": "- " * (MOST_BYTES // 2),
    "deep questions": "? " * (MOST_BYTES // 2),
    "deep lines": "".join(" " * i + "a:\n" for i in range(400)),
    "many values": "[" + "1," * (MOST_BYTES // 2 - 2) + "]",
    "many anchors": "[" + "&a x," * (MOST_BYTES // 6) + "]",
    "many directives": "%A b\n" * (MOST_BYTES // 5),
    "one long text": "a\n" * (MOST_BYTES // 2),
    "one long block": "a: |\n" + " x\n" * (MOST_BYTES // 3 - 2),
    "escapes": '"' + "\\x41" * (MOST_BYTES // 4 - 2) + '"',
}


@pytest.mark.parametrize("name", LARGE)
def test_what_is_no_fleet_file_is_refused_at_once_in_little_memory(name):
    text = LARGE[name] * (131 << 20 if name == "131 MB" else 1)
    before_kib, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(FleetFileError) as caught:
        parse_fleet(text)
    assert time.process_time() - began < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 100 << 10
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]", "[fe80::1%eth0]", "localhost", "boat-1.local", "a1.b2", "1a"])
def test_hosts_that_mean_one_thing_are_taken(host):
    assert parse_fleet(GOOD.replace("127.0.0.1:14700", f"{host}:14700")).feed.listen == f"{host}:14700"
    assert address_of(f"{host}:14700", "feed.listen") == (host.strip("[]"), 14700), "as sockets take it"


@pytest.mark.parametrize("kind", ["folder", "device", "pipe", "none", "nul", "latin", "large", "long name"])
def test_what_cannot_be_a_fleet_file_is_one_line(tmp_path, kind):
    path = tmp_path / "FLEET.yaml"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "latin":
        path.write_bytes(GOOD.encode() + b"# \xe9\n")
    elif kind == "large":
        path.write_text(GOOD + "#" * MOST_BYTES)
    named = {"device": "/dev/zero", "nul": f"{path}\0", "long name": tmp_path / ("a" * 300)}.get(kind, path)
    with pytest.raises(FleetFileError) as caught:
        load_fleet(named)
    assert "give" in str(caught.value)


@pytest.mark.parametrize(
    ("fence", "said"),
    [
        ("{xmin_m: 0, ymin_m: 0, xmax_m: 0.3, ymax_m: 40}", "too small to keep"),
        ("{xmin_m: 0, ymin_m: 0, xmax_m: 2.5, ymax_m: 40}", "narrower than the separation"),
        ("{xmin_m: 0, ymin_m: 0, xmax_m: 5, ymax_m: 5}", "no room for 5 boats 2.5 m apart"),
    ],
)
def test_a_geofence_too_small_for_its_boats_is_refused_with_the_file(fence, said):
    text = fleet_text(blue=5, red=5).replace("{xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}", fence)
    with pytest.raises(FleetFileError, match=f"geofence.*{said}"):
        parse_fleet(text)
    assert parse_fleet(text + "\nshield: {edge_m: null}"), "an edge that is not kept needs no room"


def test_a_geofence_must_fit_the_error_of_positions_too():
    box = "{xmin_m: 0, ymin_m: 0, xmax_m: 20, ymax_m: 20}"
    text = GOOD.replace("{xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}", box)
    assert parse_fleet(text)
    with pytest.raises(FleetFileError, match=r"too small to keep 12\.2 m"):
        parse_fleet(text + "\nshield: {position_error_m: 12.0}")
