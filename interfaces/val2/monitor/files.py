"""Programs and values on disk: in one directory, or, for who sits at this machine, anywhere."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from interfaces.system import write_whole
from interfaces.val2.errors import ValError

SUFFIX: Final = ".v2"
"""Of files that are named without any."""
LARGEST: Final = 4_000_000
"""Longest file that is read [B]."""
_OFFERED: Final = 40
"""Longest list that's offered."""
_PLAIN: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")


class Files:
    """A directory of files."""

    def __init__(self, directory: Path, *, anywhere: bool = False, examples: Path | None = None) -> None:
        """Say where.

        Args:
            directory: Where files without a path are.
            anywhere: Whether paths may lead out of it; else only plain names ending in `.v2` are taken.
            examples: Where files are looked for that aren't there; nothing is written to it.
        """
        self.directory, self.anywhere, self._examples = directory, anywhere, examples

    def path(self, name: str) -> Path:
        """The file that a name stands for.

        Raises:
            ValError: If it's none, or isn't allowed.
        """
        name = name.strip().strip('"').strip()
        if not name:
            raise ValError("Missing argument", "a file's name")
        if self.anywhere:
            path = self.directory / Path(name).expanduser()
            return path if path.suffix else path.with_name(path.name + SUFFIX)
        if not _PLAIN.fullmatch(name):
            raise ValError("Invalid file name", f"{name}: letters, digits, dots, - and _, and no path")
        path = self.directory / (name if "." in name else name + SUFFIX)
        if path.suffix != SUFFIX:
            raise ValError("Invalid file name", f"{name}: it ends in {SUFFIX}")
        if not path.resolve().is_relative_to(self.directory.resolve()):
            raise ValError("Invalid file name", f"{name}: it leads somewhere else")
        return path

    def found(self, name: str) -> Path:
        """The file that's read for a name: in the directory, or else an example.

        Raises:
            ValError: See `path`.
        """
        path = self.path(name)
        if self._examples is None or path.is_file():
            return path
        example = Files(self._examples).path(name) if _PLAIN.fullmatch(path.name) else path
        return example if example.is_file() else path

    def offered(self) -> list[str]:
        """Names of examples, then of the files in the directory, that LOAD takes; not too many."""
        examples = [] if self._examples is None else Files(self._examples).listed()
        with contextlib.suppress(ValError):
            examples += [name for name in self.listed() if name not in examples]
        return [name for name in examples if _PLAIN.fullmatch(name)][:_OFFERED]

    def read(self, path: Path) -> str:
        """A file's text.

        Raises:
            ValError: If it can't be read, or is too long.
        """
        with _tried(path.name):
            if not path.is_file():
                raise ValError("Nonexistent file", path.name)
            with path.open("rb") as file:
                data = file.read(LARGEST + 1)
        if len(data) > LARGEST:
            raise ValError("File error", f"{path.name}: longer than {LARGEST} bytes")
        return data.decode("utf-8", errors="replace")

    def write(self, path: Path, text: str) -> None:
        """Write a file, whole or not at all.

        Raises:
            ValError: If it can't be written.
        """
        with _tried(path.name):
            write_whole(path, text.encode())

    def delete(self, path: Path) -> None:
        """Delete a file.

        Raises:
            ValError: If it can't be deleted.
        """
        with _tried(path.name):
            path.unlink()

    def rename(self, old: Path, new: Path) -> None:
        """Give a file another name; one that has it is replaced.

        Raises:
            ValError: If it can't be.
        """
        with _tried(old.name):
            old.replace(new)

    def shown(self, path: Path) -> str:
        """A file as people are told of it: by its name, or how to get there where it's elsewhere."""
        return path.name if path.parent == self.directory else str(path.resolve())

    def listed(self) -> list[str]:
        """The names of the files in the directory, without the usual suffix; those of others where they're taken.

        Raises:
            ValError: If it can't be read.
        """
        with _tried(self.directory):
            paths = self.directory.glob("*" if self.anywhere else f"*{SUFFIX}")
            plain = (path for path in paths if not path.name.startswith(".") and path.is_file())
            return sorted(path.stem if path.suffix == SUFFIX else path.name for path in plain)


@contextlib.contextmanager
def _tried(name: str | Path) -> Iterator[None]:
    """Raise what goes wrong with a file as VAL's error."""
    try:
        yield
    except OSError as error:
        raise ValError("File error", f"{name}: {error.strerror}") from None
