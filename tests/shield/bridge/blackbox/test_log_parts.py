"""A long log is a series of files: memory does not grow with it, and it is read and proved as one."""

import contextlib
import dataclasses
import gc
import tracemalloc

import pytest
from logged_runs import Encounter, header_of
from mcap.reader import make_reader
from steerclear.experiments.deploy.replaying import prove
from steerclear.shield.bridge.blackbox import Disk, LogReader, McapWriter
from steerclear.shield.bridge.blackbox.mcap_file import McapFile
from steerclear.shield.bridge.blackbox.mcap_writer import _Store
from steerclear.shield.bridge.blackbox.parts import later_parts, number_of, part_path
from steerclear.shield.exceptions import BridgeError

STEPS, PART_S = 60, 2.0


@pytest.fixture(scope="module")
def ticks():
    return list(Encounter(header_of(), STEPS))


@pytest.fixture
def log(tmp_path, ticks):
    """Path of a log of three parts of 2 s each."""
    path = tmp_path / "a[1] run.mcap"
    writer = McapWriter(path, header_of(), part_s=PART_S)
    for tick in ticks:
        writer.take(tick)
    writer.close()
    assert writer.fault == ""
    return path


def read(path):
    with LogReader(path) as reader:
        return [tick.number for tick in reader.ticks()], reader.complete, reader.damage, len(reader.files)


def test_the_parts_are_read_as_one(log):
    assert read(log) == (list(range(STEPS)), True, [], 3)
    assert sorted(path.name for path in log.parent.iterdir()) == [
        "a[1] run.mcap",
        "a[1] run.part2.mcap",
        "a[1] run.part3.mcap",
    ]


def test_the_parts_are_proved_as_one(log):
    with LogReader(log) as reader:
        proof = prove(reader.header, reader.ticks())
    assert (proof.ticks, proof.same, proof.missing) == (STEPS, STEPS, [])


def test_each_part_is_a_whole_log_with_an_index(log):
    for number in (1, 2, 3):
        with part_path(log, number).open("rb") as file:
            reader = make_reader(file)
            assert reader.get_summary().statistics.channel_message_counts
            assert sum(channel.topic == "/header" for _, channel, _ in reader.iter_messages()) == 1
    found, complete, damage, files = read(part_path(log, 2))
    assert found == list(range(20, STEPS))
    assert (complete, damage, files) == (True, [], 2)
    with LogReader(part_path(log, 3)) as reader:
        assert reader.header.notes["part"] == "3"


def test_a_part_that_is_missing_is_told_and_nothing_after_it_is_read(log):
    part_path(log, 2).unlink()
    found, complete, damage, files = read(log)
    assert found == list(range(20))
    assert not complete
    assert files == 1
    assert "part 2" in damage[0]


def test_a_part_of_another_log_is_left_out(log, ticks):
    other = log.with_name("other.mcap")
    McapWriter(other, dataclasses.replace(header_of(), unix_ns=1)).close()
    part_path(log, 2).write_bytes(other.read_bytes())
    found, complete, damage, _ = read(log)
    assert found == list(range(20))
    assert not complete
    assert "another log" in damage[0]


def test_a_part_that_was_cut_off_is_told_and_the_next_is_read(log):
    part_path(log, 2).write_bytes(part_path(log, 2).read_bytes()[:-200])
    found, complete, damage, files = read(log)
    assert found[-1] == STEPS - 1
    assert files == 3
    assert not complete
    assert any("cut off" in text for text in damage)


@pytest.mark.parametrize("number", [1, 2, 3])
def test_only_the_part_that_was_cut_off_is_named(log, number):
    cut = part_path(log, number)
    cut.write_bytes(cut.read_bytes()[:-200])
    _, complete, damage, files = read(log)
    assert (complete, files) == (False, 3)
    assert [text for text in damage if "was cut off" in text] == [f"{cut.name} was cut off"] * (number < 3)


class FullLater(Disk):
    """No new file finds room after the first."""

    def __init__(self, path):
        if ".part" in path.name:
            raise_full(path)
        super().__init__(path)


def raise_full(path):
    raise BridgeError(f"cannot begin the log {path}: the disk is full; free space on it")


def test_a_disk_full_at_the_next_part_is_told_and_what_came_before_is_kept(tmp_path, ticks):
    path = tmp_path / "run.mcap"
    writer = McapWriter(path, header_of(), part_s=PART_S, open_disk=FullLater)
    for tick in ticks:
        with contextlib.suppress(BridgeError):  # from the moment on at which the writer's thread has found it full
            writer._spool.put(tick)
    writer.close()
    assert "the disk is full" in writer.fault
    assert read(path)[:2] == (list(range(20)), True)


@pytest.mark.parametrize(
    ("name", "first", "number"),
    [("x.mcap", "x.mcap", 1), ("x.part7.mcap", "x.mcap", 7), ("x.part0.mcap", "x.part0.mcap", 1)],
)
def test_names_of_parts(tmp_path, name, first, number):
    assert number_of(tmp_path / name) == (tmp_path / first, number)
    assert list(later_parts(tmp_path / name)) == []
    assert part_path(tmp_path / first, number) == tmp_path / name


class NoSync(Disk):
    def sync(self):
        return


def grown_kib(ticks, folder, part_s, seconds):
    """Memory after that long less memory after 20 s, at the run's own flushes."""

    def begin(number, last):
        return McapFile(NoSync(part_path(folder / "run.mcap", number)), header_of())

    store, sizes = _Store(begin, part_s), []
    tracemalloc.start()
    for number in range(10 * seconds):
        tick = dataclasses.replace(ticks[number % STEPS], number=number, began_s=1000.25 + 0.1 * number)
        store.keep(tick)
        if number % 5 == 4:
            store.flush()
        if number % 200 == 199:
            gc.collect()
            sizes.append(tracemalloc.get_traced_memory()[0] / 1024.0)
    tracemalloc.stop()
    store.finish()
    return sizes[-1] - sizes[0]


def test_memory_does_not_grow_with_the_log(tmp_path, ticks):
    for name in ("whole", "parts"):
        (tmp_path / name).mkdir()
    assert grown_kib(ticks, tmp_path / "whole", 1e9, 100) > 60.0, "one file's index grows: what parts are for"
    assert grown_kib(ticks, tmp_path / "parts", 10.0, 100) < 30.0
