"""Files: JSON with a stable byte order, digests, and what is written whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import shutil
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gpsim.errors import UsageError

Json = dict[str, Any]
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
REFUSED = (
    errno.ELOOP,
    errno.EACCES,
    errno.EROFS,
    errno.EPERM,
    errno.ENOTDIR,
    errno.EEXIST,
    errno.ENAMETOOLONG,
)
MOST_JSON = 64 << 20  # bytes of a JSON file; a diagnosis takes 1 MiB
NO_SPACE = "no space left on the device"


def canonical(content: Any) -> bytes:
    """JSON bytes that are equal for equal content; NaN and infinity are refused."""
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()


def write_json(path: Path, content: Any) -> None:
    """Readable JSON with a stable byte order."""
    path.write_text(json.dumps(content, indent=2, sort_keys=False, allow_nan=False) + "\n", encoding="utf-8")


def plain(content: Any) -> Any:
    """JSON without NumPy's numbers; what is not finite is null."""
    if isinstance(content, Mapping):
        return {str(k): plain(v) for k, v in content.items()}
    if isinstance(content, list | tuple):
        return [plain(v) for v in content]
    if hasattr(content, "item"):  # a NumPy scalar
        content = content.item()
    return None if isinstance(content, float) and not math.isfinite(content) else content


@contextmanager
def written_whole(path: Path, ending: str = "") -> Iterator[Path]:
    """A name beside `path`, to make a file or a folder there: renamed to `path` if the block ends well, else removed.

    A file that is there is replaced; a folder that holds something is not: remove it as the block's last act. ending:
    of the name, where a writer chooses its format by that.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}{ending}")
    _remove(temporary)
    try:
        yield temporary
        temporary.replace(path)
    finally:
        _remove(temporary)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def regular_bytes(path: Path, most: int) -> bytes:
    """A file's bytes; raises OSError, and UsageError for what is no regular file or larger than `most` bytes.

    A pipe or a device is not waited for: it is refused.
    """
    with os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC), "rb") as stream:
        facts = os.fstat(stream.fileno())
        if not stat.S_ISREG(facts.st_mode):
            raise UsageError(f"{path}: is not a regular file; put the file itself there")
        if facts.st_size > most:
            raise UsageError(f"{path}: {facts.st_size} bytes; the limit is {most}")
        return stream.read(most)


def read_json(path: Path) -> Any:
    """A JSON file's content; raises FileNotFoundError, and UsageError for all else that is wrong with it."""
    try:
        return json.loads(regular_bytes(path, MOST_JSON))
    except FileNotFoundError:
        raise
    except OSError as error:
        raise unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise UsageError(f"{path}: not readable as JSON ({in_words(error)}); make it again") from error


def read_object(path: Path) -> Json:
    """A JSON file's object, by its keys; raises UsageError."""
    try:
        content = read_json(path)
    except FileNotFoundError as error:
        raise unreadable(path, error) from error
    if not isinstance(content, dict):
        raise UsageError(f"{path}: holds a {type(content).__name__} where keys were expected; make it again")
    return content


def in_words(error: Exception) -> str:
    """What is wrong with a JSON file."""
    return "nested too deeply" if isinstance(error, RecursionError) else str(error)


def file_digest(path: Path) -> str:
    """sha256 of a file, read in chunks; raises UsageError where it cannot be read."""
    if path.exists() and not path.is_file():  # a pipe is waited for, a device read, for ever
        raise UsageError(f"{path}: is not a regular file; name the file itself")
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from error


def files_below(folder: Path) -> Iterator[Path]:
    """Every file below a folder; raises UsageError where one of its folders cannot be read."""
    try:
        for root, _, names in os.walk(folder, onerror=_raise):
            yield from (path for name in names if (path := Path(root, name)).is_file())
    except OSError as error:
        raise unreadable(folder, error) from error


def everything_below(folder: Path) -> Iterator[Path]:
    """Whatever lies below a folder and is no folder: files, and also links, pipes and sockets; no link is followed.

    Raises UsageError where one of its folders cannot be read.
    """
    try:
        for root, folders, names in os.walk(folder, onerror=_raise):
            yield from (Path(root, name) for name in names)
            yield from (path for name in folders if (path := Path(root, name)).is_symlink())
    except OSError as error:
        raise unreadable(folder, error) from error


def _raise(error: OSError) -> None:
    raise error


def unreadable(path: Path, error: OSError) -> UsageError:
    """The one line about a file or a folder that cannot be read."""
    where = path if error.filename is None else error.filename
    return UsageError(
        f"{where}: cannot be read ({error.strerror or error}); make it readable, or name another file"
    )


@contextmanager
def disk_errors(place: Path, option: str = "runs_dir or --out") -> Iterator[None]:
    """A full or read-only disk is the user's to mend: one line about `place`, where the block writes.

    option: the setting that names another place.
    """
    try:
        yield
    except OSError as error:
        if error.errno in FULL or tells_of_full_disk(str(error)):  # copying a tree tells what it met as texts
            raise UsageError(
                f"{place}: {NO_SPACE}; finished artifacts are complete; free space and run again"
            ) from error
        if error.errno in REFUSED:
            raise UsageError(
                f"{place}: cannot write here ({error.strerror}); choose another {option}"
            ) from error
        raise


def tells_of_full_disk(said: str) -> bool:
    """Whether an error's words, another program's say, are those of a full disk."""
    return NO_SPACE in said or any(os.strerror(code) in said for code in FULL)
