"""Which function carries out which command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

from interfaces.val2.monitor import commands, locations, running, settings, storage
from interfaces.val2.monitor.editor import edit
from interfaces.val2.monitor.state import Dialogue

Handler: TypeAlias = Callable[..., Dialogue | None]
"""Called with the desk, what follows the name, and `now`; what takes the next line, or None."""

HANDLERS: Final[dict[str, Handler]] = {
    "ABORT": running.abort,
    "AT": running.at,
    "BASE": locations.base,
    "CALIBRATE": settings.calibrate,
    "COPY": storage.copy,
    "DELETE": storage.delete_programs,
    "DELETEL": storage.delete_values("location"),
    "DELETEP": storage.delete_programs,
    "DELETER": storage.delete_values("real"),
    "DELETES": storage.delete_values("string"),
    "DIRECTORY": storage.directory,
    "DISABLE": settings.disable,
    "DO": running.do,
    "EDIT": edit,
    "ENABLE": settings.enable,
    "EXECUTE": running.execute,
    "FLIST": storage.flist,
    "FREE": storage.free,
    "HELP": commands.help_,
    "HERE": locations.here,
    "ID": storage.identity,
    "IO": settings.io,
    "LISTF": storage.flist,
    "LISTL": storage.listl,
    "LISTP": storage.listp,
    "LISTR": storage.listr,
    "LISTS": storage.lists,
    "LOAD": storage.load,
    "NEXT": running.next_,
    "PANIC": running.panic,
    "PARAMETER": settings.parameter,
    "POINT": locations.point,
    "PROCEED": running.proceed,
    "RENAME": storage.rename,
    "RESET": settings.reset,
    "RETRY": running.retry,
    "REWIND": locations.rewind,
    "SIGNAL": settings.signal,
    "SPEED": settings.speed,
    "STATUS": running.status,
    "STORE": storage.store(""),
    "STOREL": storage.store("L"),
    "STOREP": storage.store("P"),
    "STORER": storage.store("R"),
    "STORES": storage.store("S"),
    "SWITCH": settings.switch,
    "TEACH": locations.teach,
    "TIMELINE": running.timeline,
    "TOOL": locations.tool,
    "UNDO": running.undo,
    "WHERE": locations.where,
    "XSTEP": running.xstep,
    "ZERO": storage.zero,
}
"""By command; EXIT and QUIT are the monitor's own."""
