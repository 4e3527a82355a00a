"""Reading logs that are whole, cut anywhere, or damaged anywhere."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from logged_runs import Encounter, header_of, write_log
from steerclear.shield.bridge.blackbox import LogReader, McapWriter
from steerclear.shield.exceptions import LogError

quick = settings(max_examples=80, deadline=None, derandomize=True)
STEPS, CHUNK = 60, 5


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log with a chunk every few ticks, its ticks, and its bytes."""
    folder = tmp_path_factory.mktemp("log")
    ticks = list(Encounter(header_of(), STEPS))
    writer = McapWriter(folder / "run.mcap", header_of(), flush_s=0.0)
    for tick in ticks:
        writer.take(tick)
    writer.close()
    return folder, ticks, (folder / "run.mcap").read_bytes()


def numbers(path):
    with LogReader(path) as log:
        found = [tick.number for tick in log.ticks()]
        return found, log.complete, log.damage


def test_a_whole_log(log):
    folder, ticks, _ = log
    found, complete, damage = numbers(folder / "run.mcap")
    assert found == list(range(STEPS))
    assert complete
    assert damage == []
    with LogReader(folder / "run.mcap") as reader:
        for tick, back in zip(ticks, reader.ticks(), strict=True):
            assert back.fleet.state.tobytes() == tick.fleet.state.tobytes()
            assert back.decisions.filtered.values.tobytes() == tick.decisions.filtered.values.tobytes()
            assert np.array_equal(back.decisions.bound, tick.decisions.bound)
            assert back.readings == tick.readings or "nan" in repr(tick.readings)
            assert back.actions == tick.actions


@quick
@given(share=st.floats(0.0, 1.0))
def test_a_log_cut_anywhere_gives_what_came_before(log, share):
    folder, _, whole = log
    path = folder / "cut.mcap"
    size = int(share * (len(whole) - 1))
    path.write_bytes(whole[:size])
    if size < whole.index(b"/header") + 9000:  # the header's own chunk may be cut
        with contextlib.suppress(LogError):
            assert numbers(path)[0] == list(range(len(numbers(path)[0])))
        return
    found, complete, _ = numbers(path)
    assert found == list(range(len(found)))
    assert not complete
    assert len(found) >= STEPS * (share - 0.35)


@quick
@given(data=st.data())
def test_a_log_damaged_anywhere_gives_what_is_sound(log, data):
    folder, ticks, whole = log
    at = data.draw(st.integers(0, len(whole) - 1))
    path = folder / "damaged.mcap"
    path.write_bytes(whole[:at] + bytes([whole[at] ^ data.draw(st.integers(1, 255))]) + whole[at + 1 :])
    try:
        with LogReader(path) as reader:
            back = list(reader.ticks())
    except LogError:
        return
    for tick in back:  # what a checksum let through is what was written
        assert tick.fleet.state.tobytes() == ticks[tick.number].fleet.state.tobytes()


def test_another_programs_log_is_said(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "x.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/odom", "json", writer.register_schema("odom", "jsonschema", b"{}"))
        writer.add_message(channel, 1, b"{}", 1)
        writer.finish()
    with pytest.raises(LogError, match="holds no header"):
        LogReader(path)


def test_a_log_without_ticks_is_whole(tmp_path):
    write_log(tmp_path / "x.mcap", 0)
    assert numbers(tmp_path / "x.mcap") == ([], True, [])
