"""A FLEET.yaml means one thing: what programs read in several ways is refused; nothing in it costs time or memory."""

import math
import os
import resource
import time

import pytest
from bridge_fakes import fleet_text
from steerclear.experiments.sim_boats.demo import demo_text
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet
from steerclear.shield.bridge.fleet_yaml import LONGEST_TEXT, MOST_BYTES, read_settings
from steerclear.shield.exceptions import FleetFileError

GOOD = fleet_text(blue=2, red=2)


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
@pytest.mark.parametrize("place", ["a: {}", "- {}", "{}: a", "a: {{b: [1, {}]}}", "a: &x {}"])
def test_what_programs_read_in_several_ways_is_refused_with_the_remedy(word, place):
    with pytest.raises(FleetFileError, match=r"line 1: .*(write|correct)"):
        read_settings(place.format(word))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: &x {b: 1}\nc: {<<: *x}", "line 2: .*merge keys"),
        ("a: !!int 5", "line 1: the tag"),
        ("!!python/object:os.system {}", "the tag"),
        ("5: a", "the key 5 is no text"),
        ("null: a", "the key None is no text"),
        ("true: a", "the key True is no text"),
        ("? [a]\n: b", "is no text"),
        ("{a: 1, a: 2}", "key 'a' is given twice"),
        ("a: {b: 1,\n b: 2}", "line 2: key 'b' is given twice"),
        ("a: 1\n---\nb: 2", "line 2: a second document"),
        ("a: *b", "line 1: no anchor 'b'"),
        ("a: &b [*b]", "line 1: no anchor 'b' is complete"),
        ('a: "x\\0"', "cannot be seen"),
        ('a: "\\e[2J"', "cannot be seen"),
        ('a: "\\ud800"', "cannot be seen"),
        ('a: "\\u202e"', "cannot be seen"),
        ("a: \x00", "character"),
        ("a: " + "9" * 5000, "5000 characters"),
        ("a: " + "9" * 40, "40 characters; round it"),
        ("a: " + "x" * (LONGEST_TEXT + 1), "at most 1000"),
    ],
)
def test_what_has_no_place_in_a_fleet_file_is_refused(text, said):
    with pytest.raises(FleetFileError, match=said) as caught:
        read_settings(text)
    assert str(caught.value).isprintable()


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
}  # fmt: skip


@pytest.mark.parametrize("name", LARGE)
def test_what_is_no_fleet_file_is_refused_at_once_in_little_memory(name):
    text = LARGE[name] * (131 << 20 if name == "131 MB" else 1)
    before_kib, began = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
    with pytest.raises(FleetFileError) as caught:
        parse_fleet(text)
    assert time.process_time() - began < 5.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 100 << 10
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("system_id: 1}", "system_id: true}", "boats[0].link.system_id"),
        ("system_id: 1}", 'system_id: "1"}', "boats[0].link.system_id"),
        ("system_id: 1}", "system_id: 1.0}", "boats[0].link.system_id"),
        ("system_id: 1}", "system_id: ²}", "boats[0].link.system_id"),
        ("version: 1", "version: true", "version"),
        ("version: 1", "version: 1.0", "version"),
        ("version: 1", 'version: "1"', "version"),
        ("latitude_deg: 42.0", "latitude_deg: false", "latitude_deg"),
        ("latitude_deg: 42.0", "latitude_deg: '42.0'", "latitude_deg"),
        ("size_m: [80, 40]", "size_m: [80, true]", "size_m[1]"),
        ("size_m: [80, 40]", "size_m: 8040", "size_m"),
        ("name: blue_1", "name: 7", "boats[0].name"),
        ("name: blue_1", "name: null", "boats[0].name"),
        ("name: blue_1", "name: [a]", "boats[0].name"),
        ("platform: heron", "platform: 3", "platform"),
        ("team: blue", "team: true", "team"),
        ("team: blue", "team: blue\nrate_hz: .inf", "rate_hz"),
        ("team: blue", "team: blue\nrate_hz: '10'", "rate_hz"),
        ("team: blue", "team: blue\nlog_dir: 5", "log_dir"),
        ("team: blue", "team: blue\nlog_dir: true", "log_dir"),
        ("contact: feed", "contact: feed, commanded: 1", "commanded"),
        ("contact: feed", "contact: feed, commanded: 'false'", "commanded"),
        ("contact: feed", "contact: feed, agents: 1", "agents"),
        ('"127.0.0.1:14700"', '"127.0.0.1:²"', "feed.listen"),
        ('"127.0.0.1:14700"', '"127.0.0.1:٣٣"', "feed.listen"),
        ('"127.0.0.1:14700"', '"a b:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', '"127.0.0.010:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', '"010:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', '"0x7f000001:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', '"127.1:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', '"[::1:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', '"[::zz]:14700"', "feed.listen"),
        ('"127.0.0.1:14700"', f'"{"a" * 70}:14700"', "feed.listen"),
        ('"udpin:127.0.0.1:14550"', '"udpin:127.0.0.1:²"', "blue_1"),
        ('"udpin:127.0.0.1:14550"', '"serial:/dev/ttyUSB0:²"', "serial:DEVICE:BAUD"),
        ('"udpin:127.0.0.1:14550"', '"serial::9600"', "serial:DEVICE:BAUD"),
        ("agent_0", "agent_٣", "agent"),
    ],
)
def test_nothing_is_taken_for_something_else(old, new, place):
    assert old in GOOD
    with pytest.raises(FleetFileError) as caught:
        parse_fleet(GOOD.replace(old, new, 1))
    assert place in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_shield_may_be_given_endless_times():
    fleet = parse_fleet(GOOD + "\nshield: {deadlock_timeout_s: .inf}")
    assert fleet.shield_config.deadlock_timeout_s == math.inf


@pytest.mark.parametrize("host", ["127.0.0.1", "[::1]", "[fe80::1%eth0]", "localhost", "boat-1.local", "a1.b2", "1a"])
def test_hosts_that_mean_one_thing_are_taken(host):
    assert parse_fleet(GOOD.replace("127.0.0.1:14700", f"{host}:14700")).feed.listen == f"{host}:14700"


def test_the_file_that_comes_with_the_package_is_read_alike():
    assert parse_fleet(demo_text()).rate_hz == 10.0


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
    text = GOOD.replace("{xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}",
                        "{xmin_m: 0, ymin_m: 0, xmax_m: 20, ymax_m: 20}")  # fmt: skip
    assert parse_fleet(text)
    with pytest.raises(FleetFileError, match=r"too small to keep 12\.2 m"):
        parse_fleet(text + "\nshield: {position_error_m: 12.0}")


@pytest.mark.parametrize("end", ["\x85", "\u2028", "\u2029"])
def test_ends_of_lines_that_only_some_programs_know_are_refused(end):
    with pytest.raises(FleetFileError, match=r"line 2: programs disagree about whether U\+\w{4} ends a line"):
        read_settings(f"a: 1\nb: 2 # a comment{end}c: 3\n")


def test_bytes_are_no_text_of_a_fleet_file():
    with pytest.raises(FleetFileError, match="it is bytes; give its text"):
        read_settings(b"version: 1")
