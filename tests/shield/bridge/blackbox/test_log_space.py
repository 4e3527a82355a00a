"""The check for room on the disk."""

from collections import namedtuple

import pytest
from steerclear.shield.bridge.blackbox import check_disk, disk

Usage = namedtuple("Usage", "total used free")


def test_room_is_enough(tmp_path):
    result = check_disk(tmp_path / "logs", boats=6, minutes=1.0)
    assert result.passed
    assert result.name == "disk"
    assert result.figures["free_mib"] > result.figures["needed_mib"] > 1.0
    assert list((tmp_path / "logs").iterdir()) == []


def test_too_little_room(tmp_path, monkeypatch):
    monkeypatch.setattr(disk.shutil, "disk_usage", lambda _: Usage(1, 1, 5 * 2**20))
    result = check_disk(tmp_path, boats=6, minutes=120.0)
    assert not result.passed
    assert "5 MiB free, 247 MiB needed for 120 min; free space" in result.text


def test_a_slow_disk(tmp_path, monkeypatch):
    times = iter([0.0, 2.0])
    monkeypatch.setattr(disk.time, "monotonic", lambda: next(times))
    result = check_disk(tmp_path, boats=1, minutes=0.1)
    assert not result.passed
    assert "2.0 s" in result.text


def test_a_folder_nobody_can_write_to(tmp_path, monkeypatch):
    def refuse(_):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(disk.shutil, "disk_usage", refuse)
    result = check_disk(tmp_path, boats=1)
    assert not result.passed
    assert "writing there is not allowed" in result.text


@pytest.mark.parametrize("name", ["logs", "logs/deeper"])
def test_a_file_where_the_folder_should_be(tmp_path, name):
    (tmp_path / "logs").write_text("")
    result = check_disk(tmp_path / name, boats=1)
    assert not result.passed
    assert "set log_dir" in result.text or "give a name" in result.text
