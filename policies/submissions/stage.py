"""`Stage`: a private folder with a submission's files, whether it came as a folder or as a zip."""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import shutil
import stat
import tempfile
import zipfile
import zlib
from collections.abc import Iterable
from multiprocessing.util import Finalize
from pathlib import Path, PurePosixPath

from steerclear.shield.exceptions import PolicyError

ENTRY_FILE = "solution.py"
MAX_BYTES = 2 * 1024**3
"""Largest size of an unpacked zip, bytes."""
MAX_FILES = 20_000
"""Most files in a zip."""
WORKING_DIR = "working_dir"
"""Name under which the competition's own template looks for its files; in the stage it links back to the stage."""
NO_ENTRIES = ("__MACOSX", "__pycache__")
"""Folders that machines put beside an entry."""
DEEP = ("*/*", "*/*/*")
"""Depths searched for the file, only for the message; no deeper, since the given folder may be somebody's home."""
_CHUNK = 1 << 20


class Stage:
    """A temporary folder with the submission's files at its top; removed by `close`, on collection, or at exit.

    At exit includes that of a pool's process, which skips the interpreter's own exit; forked processes do not remove
    it. A folder's files are linked, not copied, so that files the submission writes beside itself do not reach the
    source.

    Args:
        source: folder, zip, or the ``solution.py`` itself.
        max_bytes: largest unpacked size of a zip.

    Raises:
        PolicyError: there is no submission, or the zip is broken, unsafe or too large.
    """

    def __init__(self, source: str | Path, max_bytes: int = MAX_BYTES) -> None:
        self.source = Path(source).expanduser().absolute()
        if self.source.name == ENTRY_FILE and self.source.is_file():
            self.source = self.source.parent
        if not self.source.exists():
            raise PolicyError(no_submission(self.source))
        if not (self.source.is_dir() or self.source.is_file()):  # a pipe may block and a device never end
            raise PolicyError(f"{self.source} is no plain file; give a folder or a zip with {ENTRY_FILE}")
        self._top = top = Path(tempfile.mkdtemp(prefix="steerclear-submission-"))
        self._clean = Finalize(self, shutil.rmtree, (top,), {"ignore_errors": True}, exitpriority=0)
        try:
            self.folder = self._fill(top, max_bytes)
        except BaseException:
            self.close()
            raise

    def _fill(self, top: Path, max_bytes: int) -> Path:
        if self.source.is_dir():
            self._entry = find_entry(self.source, self.source)
            folder = link_folder(self._entry, top)
        else:
            unpack(self.source, top, max_bytes)
            folder = find_entry(top, self.source)
            self._entry = self.source / folder.relative_to(top)
        with contextlib.suppress(OSError):  # without links, only the template's own paths fail
            (folder / WORKING_DIR).symlink_to(".", target_is_directory=True)
        return folder

    def told(self, text: str) -> str:
        """Return a text with files of the stage named as files of the source, such as team.zip/folder/helper.py."""
        for folder, place in ((self.folder, self._entry), (self._top, self.source)):
            for shown in dict.fromkeys((os.path.realpath(folder), str(folder))):
                text = text.replace(shown, str(place))
        return text

    def close(self) -> None:
        """Remove the folder; may be called again."""
        self._clean()


def find_entry(folder: Path, source: Path) -> Path:
    """Return the folder with ``solution.py``: this one, or its only subfolder that has it."""
    if (folder / ENTRY_FILE).is_file():
        return folder
    inside = sorted(path.parent for path in folder.glob(f"*/{ENTRY_FILE}") if path.is_file())
    inside = [path for path in inside if path.name not in NO_ENTRIES]
    if len(inside) != 1:
        found = "several: " + ", ".join(path.name for path in inside) if inside else _deeper(folder)
        raise PolicyError(f"{source} needs one {ENTRY_FILE} at its top, or in its only folder ({found})")
    return inside[0]


def _deeper(folder: Path) -> str:
    """Return where the file lies too deep, for a message."""
    found = [path for levels in DEEP for path in folder.glob(f"{levels}/{ENTRY_FILE}") if path.is_file()]
    deep = sorted(path.relative_to(folder).as_posix() for path in found)
    alike = sorted(path.name for path in folder.glob("*.py") if path.name.lower() == ENTRY_FILE)
    if alike:
        return f"{alike[0]} is there; name it {ENTRY_FILE}"
    return "none there" if not deep else f"none there, but {', '.join(deep[:3])}; zip what lies beside it"


def link_folder(source: Path, top: Path) -> Path:
    """Link everything in ``source`` into ``top``; return ``source`` itself if links cannot be made."""
    try:
        for path in source.iterdir():
            if path.name != "__pycache__":
                (top / path.name).symlink_to(path, target_is_directory=path.is_dir())
    except OSError:
        return source
    return top


def near_files(text: str | Path, names: Iterable[str] = ()) -> str:
    """Return a hint at policies that are called nearly so: files and folders beside that place, then further names."""
    path = Path(text).expanduser()
    try:
        beside = [one for one in path.parent.iterdir() if one.suffix in (".py", ".zip") or (one / ENTRY_FILE).is_file()]
    except OSError:
        beside = []
    called = {name: str(one) for one in sorted(beside) for name in (one.stem, one.name)}
    near = [called[name] for name in difflib.get_close_matches(path.name, called, n=3, cutoff=0.75)]
    found = dict.fromkeys([*near, *names])
    return f"did you mean {', '.join(found)}? " if found else ""


def no_submission(path: str | Path) -> str:
    """Return the words for a path at which nothing is."""
    return f"there is no submission at {path}; {near_files(path)}give a folder or a zip with {ENTRY_FILE}"


def unpack(archive: Path, top: Path, max_bytes: int) -> None:
    """Unpack a zip after checking every name, kind and size in it."""
    try:
        with zipfile.ZipFile(archive) as opened:
            members = opened.infolist()
            check_members(archive, members, max_bytes)
            for member in members:
                if not member.is_dir():
                    _write(opened, member, top)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError, zlib.error) as error:
        raise PolicyError(f"{archive} cannot be unpacked: {error}; zip the folder with {ENTRY_FILE} again") from error


def check_members(archive: Path, members: list[zipfile.ZipInfo], max_bytes: int) -> None:
    """Refuse an archive that is too large or holds anything but plain files and folders inside it."""
    if len(members) > MAX_FILES:
        raise PolicyError(f"{archive} has {len(members)} files, more than {MAX_FILES}; leave out what is not needed")
    total = sum(member.file_size for member in members)
    if total > max_bytes:
        raise PolicyError(f"{archive} unpacks to {total} bytes, more than {max_bytes}; raise max_bytes if you trust it")
    for member in members:
        mode = member.external_attr >> 16
        if mode and stat.S_IFMT(mode) not in (0, stat.S_IFREG, stat.S_IFDIR):
            raise PolicyError(f"{archive}: {member.filename!r} is a link or a device; zip plain files only")
        if not is_inside(member.filename):
            if is_inside(member.filename.replace("\\", "/")):
                raise PolicyError(f"{archive}: {member.filename!r} has a backslash; zip it with / in its names")
            raise PolicyError(f"{archive}: {member.filename!r} would land outside its folder; zip relative paths only")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise PolicyError(f"{archive}: {member.filename!r} is packed in an unusual way; zip it with plain deflate")
        if member.flag_bits & 1:
            raise PolicyError(f"{archive}: {member.filename!r} is encrypted; zip without a password")


def is_inside(name: str) -> bool:
    """Return whether a member's name stays below its folder, on any system."""
    parts = PurePosixPath(name).parts
    return bool(parts) and not name.startswith("/") and ".." not in parts and not re.search(r"[\\\0:]", name)


def _write(opened: zipfile.ZipFile, member: zipfile.ZipInfo, top: Path) -> None:
    """Write one member; stop at the size that the archive declares (a zip bomb declares a false one)."""
    target = top / PurePosixPath(member.filename)
    target.parent.mkdir(parents=True, exist_ok=True)
    left = member.file_size
    with opened.open(member) as packed, target.open("wb") as file:
        while chunk := packed.read(_CHUNK):
            left -= len(chunk)
            if left < 0:
                raise zipfile.BadZipFile(f"{member.filename!r} is larger than declared")
            file.write(chunk)
