"""Signing: key files nobody else can read, and frames that are signed rightly, once, and now."""

import hashlib
import os
import time

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.mavlink.signing import SignatureCheck, Signing, SigningClock, read_key
from steerclear.shield.exceptions import ConfigError

KEY = bytes(range(32))
DIGITS = KEY.hex()
MINUTE = 60 * 100_000
BEAT = mavlink.MAVLink_heartbeat_message(11, 3, 1, 15, 4, 3)


def key_file(path, text, mode=0o600):
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    path.chmod(mode)
    return path


def test_a_key_is_64_digits_or_a_passphrase(tmp_path):
    assert read_key(key_file(tmp_path / "a", DIGITS + "\n")) == KEY
    assert read_key(key_file(tmp_path / "b", "correct horse\n")) == hashlib.sha256(b"correct horse").digest()


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o620, 0o602, 0o660])
def test_a_key_others_can_read_or_change_is_refused(tmp_path, mode):
    with pytest.raises(ConfigError, match="run: chmod 600"):
        read_key(key_file(tmp_path / "key", DIGITS, mode))


NO_KEYS = ["", "short", "two lines\nof passphrase", "two\rlines of it", "not\x00seen\x1b[31m", "x" * 5000]
LIKE_DIGITS = [
    *("\ufeff" + DIGITS, "0x" + DIGITS, ":".join(DIGITS[k : k + 2] for k in range(0, 64, 2)), DIGITS[:63]),
    *(DIGITS + "0", DIGITS[:32] + " " + DIGITS[32:], f'"{DIGITS}"', DIGITS + "\0", DIGITS[:-2] + "\nab", DIGITS[:32]),
]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        *((text, "neither 64 hexadecimal digits nor") for text in (*NO_KEYS, b"\xff\xfe" * 16)),
        *((text, r"looks like hexadecimal digits, .* but is not just 64") for text in LIKE_DIGITS),
    ],
)
def test_what_is_no_key_is_refused_and_digits_are_never_taken_for_a_passphrase(tmp_path, text, words):
    with pytest.raises(ConfigError, match=words):
        read_key(key_file(tmp_path / "key", text))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a\0b", r"cannot read the signing key .*; give the path of a key file"),
        ("/proc/self/mem", r"cannot read the signing key .*; give the path of a key file"),
        ("none", "cannot read the signing key"),
        (".", "no plain file"),
        ("pipe", "no plain file"),
    ],
)
def test_paths_that_cannot_be_read_are_named_at_once(tmp_path, name, words):
    os.mkfifo(tmp_path / "pipe", 0o600)
    with pytest.raises(ConfigError, match=words):
        read_key(tmp_path / name)


def test_the_key_never_shows():
    assert DIGITS not in repr(Signing(KEY))
    assert str(KEY) not in repr(Signing(KEY))
    with pytest.raises(ConfigError, match="31 bytes; give 32"):
        Signing(KEY[1:])
    with pytest.raises(ConfigError, match="link_id is 256"):
        Signing(KEY, 256)


def signed(key=KEY, at=0, system=1, link_id=1):
    """A signed heartbeat with a time stamp ``at`` ticks from now."""
    mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=1)
    mav.signing.secret_key, mav.signing.sign_outgoing, mav.signing.link_id = key, True, link_id
    mav.signing.timestamp = SigningClock().now() + at
    return bytes(BEAT.pack(mav))


def check():
    return SignatureCheck(KEY, SigningClock())


def test_only_the_right_key_is_believed_and_a_forged_time_stamp_does_not_lock_the_boat_out():
    checks, mav = check(), mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    for first in (False, True):
        assert checks.refuse(bytes(BEAT.pack(mav, force_mavlink1=first))) == "unsigned"
    assert checks.refuse(signed(key=KEY[::-1], at=1000 * MINUTE)) == "bad_signature"
    assert checks.refuse(signed()) == ""


def test_every_flipped_bit_of_a_signed_frame_is_noticed():
    frame = signed()
    for i in range(len(frame)):
        for bit in range(8):
            bent = bytearray(frame)
            bent[i] ^= 1 << bit
            assert check().refuse(bytes(bent)) != "", (i, bit)


def test_a_frame_is_believed_once_and_older_ones_never():
    checks, frame, older = check(), signed(at=MINUTE), signed(at=MINUTE // 2)
    assert [checks.refuse(frame), checks.refuse(frame), checks.refuse(older)] == ["", "replayed", "replayed"]
    assert checks.refuse(signed(at=2 * MINUTE)) == ""
    assert checks.refuse(signed(at=MINUTE + MINUTE // 2, system=2)) == "", "each sender has its own time"
    assert checks.refuse(signed(at=MINUTE + MINUTE // 2, link_id=2)) == "", "and so has each link"


def test_a_new_sender_more_than_a_minute_behind_is_refused():
    assert check().refuse(signed(at=-MINUTE // 2)) == ""
    assert check().refuse(signed(at=-2 * MINUTE)) == "old_signature"


def test_our_time_stamps_rise_when_the_wall_clock_steps_back_and_never_fall_behind_a_boat_we_believed(monkeypatch):
    clock, before = SigningClock(), time.time()
    first = clock.take()
    monkeypatch.setattr(time, "time", lambda: before - 3600.0)
    assert first < clock.take() < clock.take()
    monkeypatch.undo()
    ahead = clock.now() + 99 * MINUTE
    assert SignatureCheck(KEY, clock).refuse(signed(at=100 * MINUTE)) == ""
    assert clock.take() > ahead
