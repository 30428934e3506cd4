"""Read text files of a limited size, so that no file can fill the memory.

Devices are refused, because reading them may never end.
"""

from __future__ import annotations

import codecs
import stat
from pathlib import Path

from taichi_disk.base.errors import InputError, shown_path

# largest scene, summary or record [bytes]; a list of 100,000 numbers has 2 MB
MAX_BYTES = 10_000_000
_UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read_text(path: Path, limit: int = MAX_BYTES, accept_pipe: bool = False) -> str:
    """Return the text of a file in UTF-8, or in UTF-16 with a byte order mark.

    `limit`: largest size [bytes]; `accept_pipe`: whether the file may be a pipe, which
        waits for its writer.
    Raises OSError if the file cannot be opened. Raises InputError, with the path, if
    the file is a device, larger than `limit`, or not text.
    """
    check_file(path, limit, accept_pipe)
    with path.open("rb") as file:
        data = file.read(limit + 1)  # the size of a pipe is not known beforehand
    if len(data) > limit:
        raise _too_large(path, limit)
    encoding = "utf-16" if data.startswith(_UTF16_MARKS) else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        byte = data[error.start]
        raise InputError(
            f"{shown_path(path)}:{line}: not UTF-8 text (byte {byte:#x}): save it as"
            " UTF-8"
        ) from None


def check_file(path: Path, limit: int, accept_pipe: bool = False) -> None:
    """Raise InputError, with the path, unless `path` is a regular file of at most
    `limit` bytes, or a pipe if `accept_pipe`.

    Raises OSError if there is no such file.
    """
    status = path.stat()
    if accept_pipe and stat.S_ISFIFO(status.st_mode):
        return
    if stat.S_ISDIR(status.st_mode):
        raise InputError(f"{shown_path(path)}: is a folder, not a file")
    if not stat.S_ISREG(status.st_mode):
        raise InputError(f"{shown_path(path)}: is a device or a pipe, not a file")
    if status.st_size > limit:
        raise _too_large(path, limit)


def _too_large(path: Path, limit: int) -> InputError:
    return InputError(
        f"{shown_path(path)}: is larger than {limit / 1e6:,.0f} MB, the limit of such a"
        " file"
    )
