"""The file a black box leaves: sound MCAP for log viewers; read whole, cut or damaged anywhere; and room for it."""

import contextlib
import json
import math
from collections import namedtuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logged_runs import START_S, UNIX_NS, Encounter, header_of, reading_of, write_log
from mcap.reader import make_reader
from steerclear.shield.bridge.blackbox import Disk, LogReader, McapWriter, check_disk, disk
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.exceptions import BridgeError, LogError

quick = settings(max_examples=40, deadline=None, derandomize=True)
STEPS = 60


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    header, ticks = write_log(path, STEPS)
    return path, header, ticks


@pytest.fixture(scope="module")
def chunked(tmp_path_factory):
    """Folder, ticks and bytes of a log with a chunk every few ticks."""
    folder = tmp_path_factory.mktemp("chunks")
    ticks = list(Encounter(header_of(), STEPS))
    writer = McapWriter(folder / "run.mcap", header_of(), flush_s=0.0)
    for tick in ticks:
        writer.take(tick)
    writer.close()
    return folder, ticks, (folder / "run.mcap").read_bytes()


def messages(path):
    with path.open("rb") as file:
        return [
            (schema, channel.topic, message)
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        ]


def contents(path, topic):
    return [(message.log_time, json.loads(message.data)) for _, found, message in messages(path) if found == topic]


def read(path):
    with LogReader(path) as reader:
        return list(reader.ticks()), reader


def test_times_count_from_the_headers_clock_and_never_go_back_also_where_the_clock_does(log, tmp_path):
    path, _, ticks = log
    writer = McapWriter(tmp_path / "run.mcap", header_of())
    for tick in (ticks[2], ticks[0], ticks[1]):
        writer.take(tick)
    writer.close()
    for written, last in ((path, ticks[-1]), (tmp_path / "run.mcap", ticks[2])):
        times = [message.log_time for _, _, message in messages(written)]
        assert times == sorted(times)
        assert (times[0], times[-1]) == (UNIX_NS, UNIX_NS + round((last.began_s - START_S) * 1e9))


def understood(schema, path):
    """The forms log viewers can turn into fields: no nested arrays, no open objects, numeric enumerations."""
    assert schema["type"] == "object", path
    for name, part in schema["properties"].items():
        if "oneOf" in part:
            assert all(isinstance(choice["const"], int) for choice in part["oneOf"])
            continue
        inner = part["items"] if part["type"] == "array" else part
        if inner["type"] == "object":
            understood(inner, f"{path}.{name}")
        else:
            assert inner["type"] in ("number", "integer", "string", "boolean"), f"{path}.{name}"


def test_viewers_can_read_every_schema(log):
    for schema in {schema.id: schema for schema, _, _ in messages(log[0])}.values():
        content = json.loads(schema.data)
        assert content["title"] == schema.name
        understood(content, schema.name)


def test_the_scene_and_the_map_show_boats_where_they_are(log):
    path, header, ticks = log
    fleet = ticks[0].fleet
    assert [len(contents(path, topic)) for topic in ("/tick", "/header", "/scene", "/fix/red_2")] == [STEPS, 1, 30, 6]
    boat = contents(path, "/scene")[0][1]["entities"][0]
    pose = boat["arrows"][0]["pose"]
    assert boat["id"] == "blue_1"
    assert pose["position"]["x"] == fleet.state[0, 0]
    turn = 2.0 * math.atan2(pose["orientation"]["z"], pose["orientation"]["w"])
    assert turn == pytest.approx(math.pi / 2 - fleet.heading_rad[0])
    assert boat["cylinders"][0]["size"]["x"] == 2.0 * header.config.separation_m
    assert "PASSED" in boat["texts"][0]["text"]
    fix = contents(path, "/fix/red_1")[0][1]
    assert (fix["latitude"], fix["longitude"]) == header.frame.to_geodetic_deg(*fleet.state[2, :2])


def test_actions_are_told_when_they_begin_and_end(log):
    told = [(time_ns - UNIX_NS, row["level"], row["message"]) for time_ns, row in contents(log[0], "/log")]
    assert told == [
        (2_000_000_000, 3, "contact: red_1 is late"),
        (4_000_000_000, 2, "contact: slow is over"),
    ]


def test_texts_faults_and_notes_are_lines(tmp_path):
    tick = next(iter(Encounter(header_of(), 1)))
    reading = reading_of("blue_1", tick.fleet.state[0], START_S, texts=("EKF3 active",), faults={"signature": 2})
    writer = McapWriter(tmp_path / "run.mcap", header_of())
    writer.take(Tick(**(vars(tick) | {"readings": {"blue_1": reading}})))
    writer.note("override of blue_1 for 10 s", name="operator", warning=True)
    writer.close()
    with LogReader(tmp_path / "run.mcap") as log:
        lines = [(entry.name, entry.text) for entry in log.entries() if not isinstance(entry, Tick)]
    assert lines == [
        ("blue_1", "EKF3 active"),
        ("blue_1", "refused: signature (2)"),
        ("operator", "override of blue_1 for 10 s"),
    ]


def test_arrays_may_be_used_again_after_take(tmp_path):
    tick = next(iter(Encounter(header_of(), 1)))
    kept = tick.fleet.state.copy()
    writer = McapWriter(tmp_path / "run.mcap", header_of())
    writer.take(tick)
    for array in (tick.fleet.state, tick.nominal.values, tick.decisions.safety_margin_m):
        array[:] = 7.0
    writer.close()
    ((back,), _) = read(tmp_path / "run.mcap")
    assert back.fleet.state.tobytes() == kept.tobytes()
    assert not (back.nominal.values == 7.0).any()
    assert not (back.decisions.safety_margin_m == 7.0).any()


def test_a_log_is_never_written_over_and_a_closed_one_takes_nothing(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, 0)
    size = path.stat().st_size
    with pytest.raises(BridgeError, match="exists already"):
        McapWriter(path, header_of())
    assert path.stat().st_size == size
    writer = McapWriter(tmp_path / "closed.mcap", header_of())
    writer.close()
    writer.close()
    with pytest.raises(BridgeError, match="is closed"):
        writer.take(next(iter(Encounter(header_of(), 1))))


def test_a_whole_log_gives_every_tick_bit_for_bit_and_one_without_ticks_is_whole(chunked, tmp_path):
    folder, ticks, _ = chunked
    found, reader = read(folder / "run.mcap")
    assert (reader.complete, reader.damage) == (True, [])
    for tick, back in zip(ticks, found, strict=True):
        assert back.fleet.state.tobytes() == tick.fleet.state.tobytes()
        assert back.decisions.filtered.values.tobytes() == tick.decisions.filtered.values.tobytes()
        assert (back.number, back.actions) == (tick.number, tick.actions)
    write_log(tmp_path / "x.mcap", 0)
    found, reader = read(tmp_path / "x.mcap")
    assert (found, reader.complete, reader.damage) == ([], True, [])


@quick
@given(share=st.floats(0.0, 1.0))
def test_a_log_cut_anywhere_gives_what_came_before_and_is_no_forgery(chunked, share):
    folder, _, whole = chunked
    path = folder / "cut.mcap"
    path.write_bytes(whole[: int(share * (len(whole) - 100))])  # the footer is gone
    try:
        found, reader = read(path)
    except LogError:
        assert path.stat().st_size < whole.index(b"/header") + 9000, "cut off before the end of its header"
        return
    assert [tick.number for tick in found] == list(range(len(found)))
    assert len(found) >= STEPS * (share - 0.35)
    assert not reader.complete
    assert reader.chain.holds


@quick
@given(st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255))
def test_a_log_damaged_anywhere_gives_what_is_sound(chunked, share, change):
    folder, ticks, whole = chunked
    path, damaged = folder / "damaged.mcap", bytearray(whole)
    damaged[int(share * len(whole))] ^= change
    path.write_bytes(damaged)
    with contextlib.suppress(LogError):
        for tick in read(path)[0]:  # what a checksum let through is what was written
            assert tick.fleet.state.tobytes() == ticks[tick.number].fleet.state.tobytes()


def test_room_is_enough(tmp_path):
    result = check_disk(tmp_path / "logs", boats=6, minutes=1.0)
    assert (result.passed, result.name) == (True, "disk")
    assert result.figures["free_mib"] > result.figures["needed_mib"] > 1.0
    assert list((tmp_path / "logs").iterdir()) == []


def denied(_):
    raise PermissionError(13, "Permission denied")


@pytest.mark.parametrize(
    ("module", "name", "stands_for", "words"),
    [
        (
            disk.shutil,
            "disk_usage",
            lambda _: namedtuple("Usage", "total used free")(1, 1, 5 * 2**20),
            "5 MiB free, 247 MiB needed for 120 min; free space",
        ),
        (disk.time, "monotonic", iter([0.0, 2.0]).__next__, "2.0 s"),
        (disk.shutil, "disk_usage", denied, "writing there is not allowed"),
    ],
    ids=["full", "slow", "denied"],
)
def test_a_disk_that_is_too_full_too_slow_or_not_ours_is_said(tmp_path, monkeypatch, module, name, stands_for, words):
    monkeypatch.setattr(module, name, stands_for)
    result = check_disk(tmp_path, boats=6)
    assert not result.passed
    assert words in result.text


@pytest.mark.parametrize("name", ["logs", "logs/deeper"])
def test_a_file_where_the_folder_should_be(tmp_path, name):
    (tmp_path / "logs").write_text("")
    result = check_disk(tmp_path / name, boats=1)
    assert not result.passed
    assert "the folder is a file; set log_dir to a folder" in result.text
    with pytest.raises(BridgeError, match="the folder is a file; set log_dir to a folder"):
        Disk(tmp_path / name / "run.mcap")
