"""The chain of a log: whatever is cut out, put in, moved or altered shows; a log that was killed is no forgery."""

import dataclasses
import json
import re
import shutil
from pathlib import Path

import pytest
from forged_logs import read_records, write_records
from hypothesis import given, settings
from hypothesis import strategies as st
from logged_runs import Encounter, header_of
from mcap.opcode import Opcode
from steerclear.shield.bridge.blackbox import LogReader, McapWriter
from steerclear.shield.bridge.blackbox.format import tick_to_json
from steerclear.shield.bridge.blackbox.hash_chain import Chain, ChainHead
from steerclear.shield.exceptions import LogError

STEPS = 40
KEY, OTHER_KEY = bytes(range(32)), bytes(32)


@pytest.fixture(scope="module")
def ticks():
    return list(Encounter(header_of(), STEPS))


def write(path, ticks, **more):
    writer = McapWriter(path, header_of(), flush_s=0.0, **more)
    for tick in ticks:
        writer.take(tick)
    writer.note("the end")
    writer.close()
    assert writer.fault == ""
    return path


@pytest.fixture(scope="module")
def log(tmp_path_factory, ticks):
    return write(tmp_path_factory.mktemp("chain") / "run.mcap", ticks)


def check(path, key=None):
    """What the chain says, and the numbers of the ticks."""
    with LogReader(path, key) as reader:
        numbers = [tick.number for tick in reader.ticks()]
        return reader.chain, numbers


def said(path, key=None):
    return "; ".join(check(path, key)[0].breaks)


def test_a_log_as_it_was_written_has_a_chain_that_holds_and_every_record_is_under_a_link(log):
    chain, numbers = check(log)
    assert chain.holds
    assert (chain.chained, chain.keyed, chain.broken, chain.breaks) == (True, False, 0, [])
    assert numbers == list(range(STEPS))
    records = read_records(log)
    links = [record.content for record in records if record.topic == "/link"]
    assert len(links) >= STEPS
    assert records[-1].topic == "/link"
    assert links[-1]["end"] == "log"
    assert links[-1]["count"] == len(records) - len(links)
    assert [link["end"] for link in links[:-1]] == [""] * (len(links) - 1)


def at(records, topic, number):
    """Place of a record of a topic among all; -1 the last."""
    return [k for k, record in enumerate(records) if record.topic == topic][number]


def without(records, first, last=None):
    """Records without those from one place up to another."""
    return records[:first] + records[(first + 1) if last is None else last :]


def changed(records, k, /, **content):
    return [*records[:k], records[k].with_content(**content), *records[k + 1 :]]


def relabelled(records, k, **head):
    return [*records[:k], dataclasses.replace(records[k], **head), *records[k + 1 :]]


def swapped(records, a, b):
    found = list(records)
    found[a], found[b] = records[b], records[a]
    return found


MISSING, BEFORE, ALTERED = "records are missing", "records are missing before record", "not as they were written"
CLOSED = "its end was cut off and the file closed again"
FORGERIES = {
    "cut_out": (lambda r: without(r, at(r, "/tick", 10)), f"1 {BEFORE}"),
    "cut_out_with_its_link": (lambda r: without(r, at(r, "/tick", 10), at(r, "/tick", 11)), BEFORE),
    "cut_out_the_middle": (lambda r: without(r, at(r, "/tick", 10), at(r, "/tick", 20)), BEFORE),
    "cut_out_a_line": (lambda r: without(r, at(r, "/log", 0)), f"1 {MISSING}"),
    "put_in": (lambda r: [*r[: at(r, "/tick", 10) + 1], *r[at(r, "/tick", 10) :]], "1 records are too many"),
    "put_in_before_the_header": (lambda r: [r[at(r, "/log", 0)], *r], "1 records stand before the header"),
    "moved": (lambda r: swapped(r, at(r, "/tick", 10), at(r, "/tick", 11)), ALTERED),
    "altered": (lambda r: changed(r, at(r, "/tick", 10), policy_age_s=0.25), ALTERED),
    "altered_header": (lambda r: changed(r, 0, policy="another"), "of records 1 to 1 "),
    "altered_line": (lambda r: changed(r, at(r, "/log", 0), message="all is well"), ALTERED),
    "altered_time": (lambda r: relabelled(r, at(r, "/tick", 10), log_time=r[at(r, "/tick", 10)].log_time + 1), ALTERED),
    "altered_topic": (lambda r: relabelled(r, at(r, "/log", 0), topic="/hidden"), ALTERED),
    "altered_link": (lambda r: changed(r, at(r, "/link", 10), digest="0" * 64), ALTERED),
    "damaged_link": (lambda r: changed(r, at(r, "/link", 10), digest="zero", count=None), "link of the log's chain is"),
    "no_links": (lambda r: [record for record in r if record.topic != "/link"], CLOSED),
    "cut_off_and_closed": (lambda r: r[: at(r, "/tick", 20)], CLOSED),
    "cut_off_at_a_link_and_closed": (lambda r: r[: at(r, "/link", 20) + 1], CLOSED),
    "cut_off_and_ended": (lambda r: [*r[: at(r, "/tick", 20)], r[-1]], MISSING),
    "cut_off_before_the_last_link": (lambda r: r[:-1], CLOSED),
    "gone_on_after_the_end": (lambda r: [*r, r[at(r, "/tick", -1)]], "records follow after the end"),
}
"""What may be done to a log's records, and what the chain says of it."""


@pytest.mark.parametrize("name", FORGERIES)
def test_what_was_done_to_a_log_shows_in_words(log, tmp_path, name):
    forge, words = FORGERIES[name]
    path = write_records(tmp_path / "forged.mcap", forge(read_records(log)))
    chain, _ = check(path)
    assert not chain.holds
    assert words in "; ".join(chain.breaks)
    assert chain.broken <= 3, "what is sound before and after is not blamed"


@pytest.mark.parametrize("before_end", [9, 12, 20, 28, 60, 200])
def test_an_altered_byte_after_the_end_of_the_chain_is_told(log, tmp_path, before_end):
    data = bytearray(log.read_bytes())
    data[-before_end] ^= 1
    path = tmp_path / "altered.mcap"
    path.write_bytes(data)
    with LogReader(log) as sound, LogReader(path) as reader:
        assert len(list(sound.ticks())) == len(list(reader.ticks())) == STEPS
        assert (sound.damage, sound.complete) == ([], True)
        assert reader.damage or not reader.complete, "a record that is taken for none looks like a cut"


def offsets_between_chunks(path):
    """Where the bytes of each record lie that is in no chunk, from the file's first to the end of its data."""
    data, at, found = path.read_bytes(), 8, []
    while data[at] != Opcode.DATA_END:
        length = 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        found += [] if data[at] == Opcode.CHUNK else range(at, at + length)
        at += length
    return [*found, *range(at, at + 13)]


@settings(max_examples=150, deadline=None, derandomize=True)
@given(data=st.data(), change=st.integers(1, 255))
def test_an_altered_byte_anywhere_in_a_closed_log_is_told(log, tmp_path_factory, data, change):
    altered = bytearray(log.read_bytes())
    between = data.draw(st.booleans())
    offset = data.draw(st.sampled_from(offsets_between_chunks(log)) if between else st.integers(0, len(altered) - 1))
    altered[offset] ^= change
    path = tmp_path_factory.mktemp("altered") / "run.mcap"
    path.write_bytes(altered)
    try:
        reader = LogReader(path)
    except LogError:
        return
    with reader:
        list(reader.entries())
        assert reader.damage or reader.chain.breaks or not reader.complete


def test_a_log_without_a_checksum_of_all_bytes_is_read_as_one_of_0_9_0(log, tmp_path):
    path = write_records(tmp_path / "run.mcap", read_records(log))
    with LogReader(path) as reader:
        assert len(list(reader.ticks())) == STEPS
        assert (reader.damage, reader.complete, reader.chain.holds) == ([], True, True)


def test_a_link_where_the_change_is_names_it(log, tmp_path):
    records = read_records(log)
    k = at(records, "/tick", 10)
    number = sum(record.topic != "/link" for record in records[: k + 1])
    text = said(write_records(tmp_path / "x.mcap", FORGERIES["altered"][0](records)))
    before, after = re.search(r"of records (\d+) to (\d+)", text).groups()
    assert int(before) <= number <= int(after)
    assert int(after) - int(before) < 10


@settings(max_examples=30, deadline=None, derandomize=True)
@given(data=st.data())
def test_no_record_but_links_can_be_left_out_doubled_or_moved(log, tmp_path_factory, data):
    records = read_records(log)
    k = data.draw(st.sampled_from([k for k, record in enumerate(records) if record.topic != "/link"]))
    place = data.draw(st.integers(0, len(records)))
    how = data.draw(st.sampled_from(["out", "twice", "move"]))
    rest = records[:k] + records[k + 1 :]
    forged = {
        "out": rest,
        "twice": [*records[:place], records[k], *records[place:]],
        "move": [*rest[:place], records[k], *rest[place:]],
    }[how]
    if forged != records and k != 0:
        assert said(write_records(tmp_path_factory.mktemp("forged") / "x.mcap", forged))


def test_a_keyed_chain_is_checked_with_its_key_only_and_a_log_without_codes_is_not_taken_for_one(tmp_path, ticks, log):
    assert "carries no codes: made without a key" in said(log, KEY)
    path = write(tmp_path / "run.mcap", ticks, key=KEY)
    chain, _ = check(path)
    assert (chain.holds, chain.keyed, chain.codes_checked) == (True, True, 0)
    chain, _ = check(path, KEY)
    assert chain.holds
    assert chain.codes_checked >= STEPS
    assert "is not of this key" in said(path, OTHER_KEY)
    assert check(path, OTHER_KEY)[0].of_another_key
    records = read_records(path)
    torn = write_records(tmp_path / "torn.mcap", [*records[:5], *records[6:]])
    assert not check(torn, OTHER_KEY)[0].of_another_key, "the chain does not hold either"
    assert not check(torn, KEY)[0].of_another_key


def chained_anew(records, head):
    """Records with links that fit them: whoever can write a log can do that, without the key."""
    chain, found = Chain(head), []
    for record in records:
        if record.topic == "/link":
            link = chain.next_link(record.content["end"])
            chain.go_on(link)
            found.append(record.with_content(**vars(link)))
        else:
            chain.add(record.topic, (record.log_time, record.publish_time, record.sequence), record.data)
            found.append(record)
    return found


@pytest.mark.parametrize("name", ["altered", "cut_out", "cut_off_and_ended"])
def test_a_forger_who_makes_the_chain_anew_is_found_by_the_key_alone(tmp_path, ticks, name):
    path = write(tmp_path / "run.mcap", ticks, key=KEY)
    head = ChainHead.from_text(read_records(path)[0].content["chain"])
    forged = write_records(tmp_path / "forged.mcap", chained_anew(FORGERIES[name][0](read_records(path)), head))
    assert check(forged)[0].holds
    assert "is not of this key" in said(forged, KEY)


COUNTS = [f'{{"head": "{"0" * 64}", "count": {count}}}' for count in ('"3"', "1.5", "true", "-1", "1e400")]


@pytest.mark.parametrize("chain", ["null", "{}", '{"head": "zz"}', '{"head": 5}', "[", *COUNTS])
def test_a_header_without_a_sound_head_is_damaged(log, tmp_path, chain):
    records = [record for record in read_records(log) if record.topic != "/link"]
    path = write_records(tmp_path / "x.mcap", [records[0].with_content(chain=chain), *records[1:]])
    with pytest.raises(LogError, match="head of its chain"):
        LogReader(path)


LOG_080 = Path(__file__).parents[1] / "data" / "log_0.8.0.mcap"


def test_a_log_of_0_8_0_is_read_and_verified_and_its_ticks_are_the_same_bit_for_bit():
    messages = [record.content for record in read_records(LOG_080) if record.topic == "/tick"]
    with LogReader(LOG_080, KEY) as reader:
        ticks = list(reader.ticks())
        assert reader.chain.holds
        assert reader.chain.codes_checked > len(ticks)
        assert (reader.complete, reader.damage) == (True, [])
        assert reader.header.versions["steerclear"] == "0.8.0"
        for tick, message in zip(ticks, messages, strict=True):
            again = json.loads(json.dumps(tick_to_json(tick, reader.header.platforms), allow_nan=False))
            for reading in again["readings"]:
                del reading["released_by"], reading["failsafe_over"], reading["commander"]  # which 0.8.0 did not know
            assert again == message


@pytest.mark.parametrize("name", ["run.part2.mcap", "run.mcap"])
def test_a_log_in_parts_is_refused_by_the_version_that_can_read_it(tmp_path, name):
    for part in ("run.mcap", "run.part2.mcap"):
        shutil.copy(LOG_080, tmp_path / part)
    with pytest.raises(LogError, match=r"is in parts, .*; replay it with steerclear 0.8.0"):
        LogReader(tmp_path / name)


def test_a_log_of_another_version_is_refused_by_the_one_that_wrote_it(log, tmp_path):
    records = read_records(log)
    versions = json.dumps({"steerclear": "0.6.1"})
    write_records(tmp_path / "old.mcap", [records[0].with_content(version=1, versions=versions), *records[1:]])
    with pytest.raises(LogError, match=r"version 1, .* use the one that wrote it, steerclear 0.6.1"):
        LogReader(tmp_path / "old.mcap")
