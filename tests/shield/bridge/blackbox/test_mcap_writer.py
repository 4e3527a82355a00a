"""The file a black box leaves: sound MCAP, in order of time, and what log viewers understand."""

import json
import math

import pytest
from logged_runs import START_S, UNIX_NS, Encounter, header_of, reading_of, write_log
from mcap.reader import make_reader
from steerclear.shield.bridge.blackbox import LogReader, McapWriter
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.exceptions import BridgeError

STEPS = 60


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("log") / "run.mcap"
    header, ticks = write_log(path, STEPS)
    return path, header, ticks


def messages(path):
    with path.open("rb") as file:
        return [
            (schema, channel.topic, message)
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False)
        ]


def test_the_index_counts_what_is_there(log):
    path, _, _ = log
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    topics = [topic for _, topic, _ in messages(path)]
    counts = summary.statistics.channel_message_counts
    by_topic = {channel.topic: counts[number] for number, channel in summary.channels.items()}
    assert by_topic == {topic: topics.count(topic) for topic in topics}
    assert by_topic["/tick"] == STEPS
    assert by_topic["/header"] == 1
    assert by_topic["/scene"] == STEPS / 2
    assert by_topic["/fix/red_2"] == 6
    assert summary.statistics.message_count == len(topics)


def test_times_never_go_back_and_count_from_the_headers_clock(log):
    path, _, ticks = log
    times = [message.log_time for _, _, message in messages(path)]
    assert times == sorted(times)
    assert times[0] == UNIX_NS
    assert times[-1] == UNIX_NS + round((ticks[-1].began_s - START_S) * 1e9)


def test_a_clock_that_steps_back_does_not_disorder_the_log(tmp_path):
    ticks = list(Encounter(header_of(), 3))
    writer = McapWriter(tmp_path / "run.mcap", header_of())
    for tick in (ticks[2], ticks[0], ticks[1]):
        writer.take(tick)
    writer.close()
    times = [message.log_time for _, _, message in messages(tmp_path / "run.mcap")]
    assert times == sorted(times)


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


def test_the_scene_shows_boats_where_they_are(log):
    path, header, ticks = log
    scene = next(json.loads(message.data) for _, topic, message in messages(path) if topic == "/scene")
    boat = scene["entities"][0]
    arrow = boat["arrows"][0]
    assert boat["id"] == "blue_1"
    assert arrow["pose"]["position"]["x"] == ticks[0].fleet.state[0, 0]
    turn = 2.0 * math.atan2(arrow["pose"]["orientation"]["z"], arrow["pose"]["orientation"]["w"])
    assert turn == pytest.approx(math.pi / 2 - ticks[0].fleet.heading_rad[0])
    assert boat["cylinders"][0]["size"]["x"] == 2.0 * header.config.separation_m
    assert "PASSED" in boat["texts"][0]["text"]


def test_the_map_shows_boats_where_they_are(log):
    path, header, ticks = log
    fix = next(json.loads(message.data) for _, topic, message in messages(path) if topic == "/fix/red_1")
    place = header.frame.to_geodetic_deg(*ticks[0].fleet.state[2, :2])
    assert (fix["latitude"], fix["longitude"]) == place


def test_actions_are_told_when_they_begin_and_end(log):
    path, _, _ = log
    told = [(message.log_time, json.loads(message.data)) for _, topic, message in messages(path) if topic == "/log"]
    assert [(row["level"], row["message"]) for _, row in told] == [
        (3, "contact: red_1 is late"),
        (2, "contact: slow is over"),
    ]
    assert [time_ns - UNIX_NS for time_ns, _ in told] == [2_000_000_000, 4_000_000_000]


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
    tick.fleet.state[:] = 7.0
    tick.wanted.values[:] = 7.0
    tick.decisions.safety_margin_m[:] = 7.0
    writer.close()
    with LogReader(tmp_path / "run.mcap") as log:
        back = next(log.ticks())
    assert back.fleet.state.tobytes() == kept.tobytes()
    assert not (back.wanted.values == 7.0).any()
    assert not (back.decisions.safety_margin_m == 7.0).any()


def test_a_log_is_never_written_over(tmp_path):
    path = tmp_path / "run.mcap"
    write_log(path, 1)
    size = path.stat().st_size
    with pytest.raises(BridgeError, match="exists already"):
        McapWriter(path, header_of())
    assert path.stat().st_size == size


def test_a_closed_log_takes_nothing(tmp_path):
    writer = McapWriter(tmp_path / "run.mcap", header_of())
    writer.close()
    writer.close()
    with pytest.raises(BridgeError, match="is closed"):
        writer.take(next(iter(Encounter(header_of(), 1))))
