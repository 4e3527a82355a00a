"""Files written completely or not at all: what is said when they cannot be, and what stays."""

import errno
import os

import pytest
from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import TraceError


def half_written(target, code):
    with whole_file(target, TraceError) as part:
        part.write_text("half")
        raise OSError(code, os.strerror(code))


@pytest.mark.parametrize(
    ("code", "remedy"),
    [(errno.ENOSPC, "Free space on that disk."), (errno.EACCES, "Choose a folder you may write to.")],
)
def test_the_remedy_fits_what_is_wrong_and_the_older_file_stays(tmp_path, code, remedy):
    target = tmp_path / "there.json"
    target.write_text("older")
    with pytest.raises(TraceError, match=f"cannot write .*there.json .*{remedy}"):
        half_written(target, code)
    assert target.read_text() == "older"
    assert os.listdir(tmp_path) == ["there.json"]
