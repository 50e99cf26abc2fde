"""Logical units of V+: files of one directory, serial lines that are files there, and the terminal, by numbers.

A file is read whole when it's opened, and written whole when it's closed. What comes over serial line 1 is the file
`serial1.in`, what goes is `serial1.out`. What can't be done is no error of the program: it goes on, and IOSTAT says
why. Networks and pendants aren't here.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from interfaces.system import write_whole

TERMINAL: Final = 4
DISKS: Final = (5, 6, 7, 8, 17, 18, 19)
"""Units of files."""
LINES: Final = range(10, 16)
"""Units of serial lines."""
OURS: Final = 4
"""Bit of ATTACH's mode: the unit's number is given back."""
DONE: Final = 1.0
EXISTS, NOT_THERE, ENDED, NOT_READY = -500.0, -501.0, -504.0, -508.0
NOT_OPEN, NOT_ATTACHED, NOT_VALID = -513.0, -516.0, -517.0
MESSAGES: Final = {
    DONE: "*Success*",
    EXISTS: "*File already exists*", NOT_THERE: "*Nonexistent file*", ENDED: "*Unexpected end of file*",
    NOT_READY: "*Device not ready*", NOT_OPEN: "*File not opened*", NOT_ATTACHED: "*Not attached to logical unit*",
    NOT_VALID: "*Invalid file specification*",
}  # fmt: skip
"""What IOSTAT gives where something couldn't be done, and $ERROR of it."""
SECTOR: Final = 512
"""In which a listing counts lengths [B]."""
LARGEST: Final = 4_000_000
"""Longest file [characters]."""
_SERIAL: Final = re.compile(r"(?:LOCAL\.)?SERIAL:?([0-5])", re.IGNORECASE)
_FOLDER: Final = re.compile(r"(?:[A-Za-z]+:)?\\?")
_NAME: Final = re.compile(r"(?:[A-Za-z]+:)?\\?([A-Za-z0-9_][A-Za-z0-9_.-]{0,99})")


@dataclass(slots=True)
class _Unit:
    """A unit that is attached."""

    path: Path | None = None
    """Of the file that is open."""
    text: str = ""
    place: int = 0
    """Up to where it's read [characters]."""
    writes: bool = False
    sent: str | None = None
    """What went over a serial line; None of a file."""

    @property
    def written(self) -> str:
        """What its file is to hold."""
        return self.text if self.sent is None else self.sent


class Units:
    """The units of a controller."""

    def __init__(
        self, directory: Path | None = None, *, keeps: bool = True, warn: Callable[[str], None] = lambda _: None
    ) -> None:
        """Attach nothing yet.

        Args:
            directory: Whose files programs may read and write; None for none at all.
            keeps: Whether what is written gets there; else it's only remembered.
            warn: Is told what isn't here.
        """
        self.directory, self._keeps, self.warn = directory, keeps, warn
        self._units: dict[int, _Unit] = {}
        self._status: dict[int, float] = {TERMINAL: DONE}
        self._written: dict[Path, str | None] = {}
        """Files as they'd be; None for deleted."""

    def attach(self, unit: int | None, device: str) -> int:
        """ATTACH a unit, or the first that's free for None; its number, 0 where none is."""
        if (line := _SERIAL.fullmatch(device)) is not None and self.directory is not None:
            return self._attach_line(LINES[int(line[1])] if unit is None else unit, f"serial{line[1]}")
        disk = device.upper().rstrip(":") in ("", "DISK", "NFS", "SYSTEM", "A", "C", "D")
        if not disk or (unit is not None and unit not in (TERMINAL, *DISKS)):
            self.warn(
                f"ATTACH {device or unit}: allowed: DISK, SERIAL:n with --files, and the terminal, {TERMINAL}"
            )
            self._status[unit or 0] = NOT_READY
            return unit or 0
        free = [number for number in DISKS if number not in self._units]
        number = unit if unit is not None else free[0] if free else 0
        if number != TERMINAL and self.directory is None:
            self.warn("ATTACH of files: no directory is given; --files DIR says where programs read and write")
            self._status[number] = NOT_READY
        elif number:
            self._units.setdefault(number, _Unit())
            self._status[number] = DONE
        return number

    def _attach_line(self, unit: int, name: str) -> int:
        assert self.directory is not None
        text = self._read(self.directory / f"{name}.in")
        if text is None:
            self.warn(f"ATTACH of a serial line: what comes is read from {name}.in, which isn't in --files DIR")
        else:
            self._units[unit] = _Unit(self.directory / f"{name}.out", text, writes=True, sent="")
        self._status[unit] = NOT_READY if text is None else DONE
        return unit

    def detach(self, unit: int) -> None:
        """DETACH: close what is open, too."""
        if unit in self._units and self._units[unit].path is not None:
            self.close(unit)
        self._status[unit] = DONE if self._units.pop(unit, None) is not None else NOT_ATTACHED

    def open(self, keyword: str, unit: int, name: str) -> None:
        """FOPENR, FOPENW, FOPENA, FOPEND: a file to read, a new one, one to add to, or the directory."""
        self._status[unit] = self._opened(keyword, unit, name)

    def _opened(self, keyword: str, unit: int, name: str) -> float:
        known, path = self._units.get(unit), self._path(name)
        if known is not None and keyword == "FOPEND" and self.directory is not None:
            self._units[unit] = _Unit(self.directory, self._listing(name))
            return DONE
        if known is None or path is None or keyword == "FOPEN":
            return NOT_ATTACHED if known is None else NOT_VALID
        text = self._read(path)
        if keyword == "FOPENW" and text is not None:
            return EXISTS
        if keyword == "FOPENR" and text is None:
            return NOT_THERE
        writes = keyword != "FOPENR"
        self._units[unit] = _Unit(path, text or "", len(text or "") if writes else 0, writes)
        return DONE

    def _listing(self, pattern: str) -> str:
        """Files of the directory that a pattern fits, a line each: name, length in sectors; dates are blank."""
        assert self.directory is not None
        wanted = (_FOLDER.sub("", pattern.strip()) or "*").replace("*.*", "*").lower()
        paths = {*self._written, *self.directory.iterdir()}
        texts = {path: text for path in sorted(paths) if (text := self._read(path)) is not None}
        return "".join(
            f"{path.stem:8}.{path.suffix[1:]:3}{-(-len(text.encode()) // SECTOR):8}{'':26}\n"
            for path, text in texts.items()
            if fnmatchcase(path.name.lower(), wanted)
        )

    def _path(self, name: str) -> Path | None:
        found = _NAME.fullmatch(name.strip())
        return None if found is None or self.directory is None else self.directory / found[1]

    def _read(self, path: Path) -> str | None:
        """The text of a file; None where there's none, or none that can be read."""
        if path in self._written:
            return self._written[path]
        try:
            inside = path.is_file() and path.resolve().parent == path.parent.resolve()
            if not inside or path.stat().st_size > LARGEST:
                return None
            return path.read_text("utf-8", errors="replace").replace("\r\n", "\n")
        except OSError:
            return None

    def close(self, unit: int) -> None:
        """FCLOSE."""
        if (known := self._open(unit)) is not None:
            assert known.path is not None
            self._status[unit] = self._write(known.path, known.written) if known.writes else DONE
            self._units[unit] = _Unit()

    def _open(self, unit: int) -> _Unit | None:
        """A unit whose file is open; of any other IOSTAT says that it isn't."""
        known = self._units.get(unit)
        if known is None or known.path is None:
            self._status[unit] = NOT_OPEN
            return None
        return known

    def delete(self, unit: int, name: str) -> None:
        """FDELETE a file."""
        path = self._path(name)
        if unit not in self._units or path is None:
            self._status[unit] = NOT_ATTACHED if path is not None else NOT_VALID
        else:
            self._status[unit] = NOT_THERE if self._read(path) is None else self._write(path, None)

    def _write(self, path: Path, text: str | None) -> float:
        try:
            if not self._keeps:
                self._written[path] = text
            elif text is None:
                path.unlink()
            else:
                write_whole(path, text.encode())
        except OSError:
            return NOT_READY
        return DONE

    def read(self, unit: int) -> str | None:
        """READ: the next line of a file; None where there's none."""
        if (known := self._open(unit)) is None:
            return None
        self._status[unit] = DONE if known.place < len(known.text) else ENDED
        if known.place >= len(known.text):
            return None
        end = known.text.find("\n", known.place)
        line = known.text[known.place : len(known.text) if end < 0 else end]
        known.place += len(line) + 1
        return line

    def seek(self, unit: int, line: int) -> None:
        """FSEEK: go to the beginning of a line, from 1."""
        if (known := self._open(unit)) is None:
            return
        lines = known.text.splitlines(keepends=True)
        there = 1 <= line <= len(lines)
        known.place = sum(map(len, lines[: line - 1])) if there else known.place
        self._status[unit] = DONE if there else ENDED

    def refuse(self, unit: int, why: float) -> None:
        """Let IOSTAT say why something couldn't be done, a line that was read not be what was wanted, such as."""
        self._status[unit] = why if unit in self._units else NOT_ATTACHED

    def character(self, unit: int) -> float:
        """GETC: the code of the next character, or why there's none."""
        known = self._units.get(unit)
        if known is None or known.path is None:
            return NOT_OPEN
        if known.place >= len(known.text):
            return ENDED
        known.place += 1
        return float(ord(known.text[known.place - 1]))

    def write(self, unit: int, text: str) -> None:
        """WRITE: add to a file."""
        if (known := self._open(unit)) is None:
            return
        assert known.path is not None
        if not known.writes:
            self._status[unit] = NOT_OPEN
        elif len(known.written) + len(text) > LARGEST:
            self._status[unit] = NOT_READY
        elif known.sent is None:
            known.text += text
            self._status[unit] = DONE
        else:
            known.sent += text
            self._status[unit] = self._write(known.path, known.sent)

    def status(self, unit: float) -> float:
        """IOSTAT: 1 where the last that was wanted of a unit is done, else why it isn't."""
        return self._status.get(int(unit), NOT_ATTACHED)
