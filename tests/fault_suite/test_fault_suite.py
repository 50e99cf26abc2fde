"""Each row of the table of faults holds, and fails where its mechanism is switched off; the page has the rows."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from robots.rooms import read_room
from tests.fault_suite.__main__ import INTRO, PAGE
from tests.fault_suite.coverage import Coverage
from tests.fault_suite.rows import ROWS
from tests.faults import HOME, copied
from vrs.errors import FormatError

SMALL = "--tries", "2", "--seconds", "2", "--load", "4", "--hours", "0.1"


class Planted(NamedTuple):
    """A mechanism that is switched off."""

    path: str
    sound: str
    faulty: str


WATCHDOG = "robots/onboard/watchdog.py"
EXPIRES = "if self._state is WatchdogState.RUNNING and now >= self._deadline:"
PLANTED = {
    "operator_killed": Planted(WATCHDOG, EXPIRES, EXPIRES.replace("deadline:", "deadline + 0.2:")),
    "operator_stopped": Planted(
        "interfaces/teleop/following_arm.py", "max(watchdog.timeout - self.lead, 0.1)", "watchdog.timeout"
    ),
    "client_killed": Planted(
        "robots/onboard/lease.py", "HELD and now >= self._deadline:", "HELD and now >= self._deadline + 9:"
    ),
    "client_stopped": Planted(
        "interfaces/stream/leasing.py",
        '        if ended is not None:\n            self._note("control ended"',
        '        if None:\n            self._note("control ended"',
    ),
    "robot_killed": Planted(
        "interfaces/runtime/live/robot_client.py",
        "return self._clock.now() - self.heard < UNHEARD and self._line.connected and not self.lost",
        "return not self.lost",
    ),
    "robot_stopped": Planted(WATCHDOG, EXPIRES, EXPIRES.replace("deadline:", "deadline + 99:")),
    "body_killed": Planted("interfaces/runtime/live/process.py", '    ended(f"the robot', '    str(f"the robot'),
    "body_stopped": Planted("interfaces/runtime/physics.py", "events.append(Silent(self._heard))", "pass"),
    "camera_killed": Planted("interfaces/media/camera.py", "self.problem = str(error)", 'self.problem = ""'),
    "recorder_killed": Planted("interfaces/recording/writer.py", "FLUSH = 0.25", "FLUSH = 60.0"),
    "recording_cut_short": Planted(
        "interfaces/recording/mcap_file.py", "rest = rest[taken:]", "rest = rest[len(rest) :]"
    ),
    "recording_full": Planted("interfaces/recording/live.py", '"problem": self.problem', '"problem": None'),
    "recording_slow": Planted("interfaces/recording/recorder.py", "STALLED = 0.75", "STALLED = 5.0"),
    "files_full": Planted("interfaces/system.py", 'path.with_name(f".{path.name}.{secrets.token_hex(4)}")', "path"),
    "audit_full": Planted("interfaces/stream/audit.py", "os.ftruncate(self._file, size)", "pass"),
    "clock_steps_and_drifts": Planted("interfaces/link/clock_sync.py", "rho = self.config.max_drift", "rho = 0.0"),
    "calendar_steps": Planted(
        "interfaces/stream/audit.py",
        "self._clock.now() >= self._due",
        "seconds_since_1970() >= self._due + 1.7e9",
    ),
    "wire_fuzzed": Planted(
        "interfaces/stream/codec.py",
        "    except (InvalidValueError, OverflowError) as error:",
        "    except KeyError as error:",
    ),
    "rsp_fuzzed": Planted("interfaces/rsp/header.py", "if not SIZE <= len(data) <= LONGEST:", "if False:"),
    "recordings_flipped": Planted(
        "interfaces/recording/mcap_reading.py", "and zlib.crc32(content) == head.checksum else None", "else None"
    ),
    "plans_fuzzed": Planted(
        "interfaces/runtime/plan.py",
        "        except UnicodeDecodeError:",
        "        except KeyError:",
    ),
    "traces_fuzzed": Planted(
        "interfaces/link/delays.py", "    except ValueError:\n        delay", "    except KeyError:\n        delay"
    ),
    "floor_plans_fuzzed": Planted(
        "robots/rooms.py",
        "        except ValueError:\n            value",
        "        except KeyError:\n            value",
    ),
    "lists_of_jobs_fuzzed": Planted(
        "interfaces/jobs/file.py",
        "UnicodeDecodeError, RecursionError, InvalidValueError) as",
        "InvalidValueError) as",
    ),
    "urdf_files_fuzzed": Planted(
        "robots/description/urdf.py",
        "        except _LIBRARY as error:\n            problem",
        "        except KeyError as error:\n            problem",
    ),
    "mjcf_files_fuzzed": Planted(
        "robots/description/mjcf.py",
        "except (ValueError, mujoco.FatalError)",
        "except (KeyError, mujoco.FatalError)",
    ),
    "models_in_toml_fuzzed": Planted(
        "robots/description/numbers.py",
        "except (msgspec.DecodeError, ValueError, RecursionError)",
        "except (msgspec.ValidationError, RecursionError)",
    ),
    "things_to_grasp_fuzzed": Planted(
        "robots/things.py",
        "except (msgspec.DecodeError, ValueError, RecursionError)",
        "except (msgspec.ValidationError, RecursionError)",
    ),
    "paths_fuzzed": Planted(
        "robots/onboard/curve.py",
        '    except ValueError:\n        raise FormatError(place, f"a point',
        '    except KeyError:\n        raise FormatError(place, f"a point',
    ),
    "gain_networks_fuzzed": Planted(
        "interfaces/middleware/network.py", "except (msgspec.DecodeError, ", "except (msgspec.ValidationError, "
    ),
    "rsp_models_fuzzed": Planted(
        "interfaces/rsp/model/xmi.py",
        "    except expat.ExpatError as",
        "    except KeyError as",
    ),
    "val_ii_files_fuzzed": Planted(
        "interfaces/val2/grammar.py",
        "    except UnexpectedInput as error:\n        token",
        "    except KeyError as error:\n        token",
    ),
    "val_ii_lines_fuzzed": Planted(
        "interfaces/val2/grammar.py",
        "    except UnexpectedInput as error:\n        token",
        "    except KeyError as error:\n        token",
    ),
    "recordings_fuzzed": Planted(
        "interfaces/recording/mcap_reading.py",
        "except (zstandard.ZstdError, MemoryError):",
        "except MemoryError:",
    ),
    "load_flooding_viewers": Planted(
        "interfaces/stream/hub.py", "self.outbox.put(Problem(ProblemCode.TOO_FAST, text))", "pass"
    ),
    "day_of_faults": Planted(
        "interfaces/teleop/following_arm.py",
        "timeline = from_commanded(timeline, p, limits).timeline",
        "timeline = timeline.edited(p, [hold(_SETTLE, timeline.sample(p))])",
    ),
}
"""Of each row what is switched off."""


def tried(tree: Path, row: str, out: Path) -> tuple[int, str]:
    """Try a row of a copy of the project at a small size; its exit status, and what it said."""
    command = [sys.executable, "-m", "tests.fault_suite", "--only", row, *SMALL, "--out", str(out)]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, timeout=600, check=False
    )
    return done.returncode, done.stdout + done.stderr


LATE = {"val_ii_lines_fuzzed"}
"""Rows that miss a time, as docs/faults.md says; their other figures hold."""


def marked(rows: Iterable[str]) -> list[Any]:
    """Rows of parsers are slow; those that are live take long, and a machine of their own."""
    return [pytest.param(row, marks=pytest.mark.slow if "fuzzed" in row else pytest.mark.faults) for row in rows]


@pytest.mark.parametrize("row", marked(row for row in PLANTED if not row.startswith("load_")))
def test_a_row_holds(row: str, tmp_path: Path) -> None:
    status, said = tried(HOME, row, tmp_path)
    missed = [line for line in said.split("\n") if "**no**" in line]
    assert status == 0 or (row in LATE and all(" ms |" in line for line in missed)), said


@pytest.mark.parametrize("row", marked(PLANTED))
def test_a_row_fails_where_its_mechanism_is_switched_off(row: str, tmp_path: Path) -> None:
    fault, tree = PLANTED[row], copied(tmp_path)
    place = tree / fault.path
    place.write_text(place.read_text(encoding="utf-8").replace(fault.sound, fault.faulty), encoding="utf-8")
    status, said = tried(tree, row, tmp_path)
    assert status == 1, said
    assert "**no**" in said


def test_each_row_has_a_mechanism_to_switch_off_but_other_loads() -> None:
    assert {row for row in ROWS if row not in PLANTED} == {
        row for row in ROWS if row.startswith("load_") and row != "load_flooding_viewers"
    }
    assert set(PLANTED) <= set(ROWS)


def test_the_page_has_the_rows() -> None:
    """Not the figures: those are a run's."""
    text = PAGE.read_text(encoding="utf-8")
    assert text.startswith(INTRO)
    assert re.findall(r"^\| \*\*(.+?)\*\* \|", text, re.MULTILINE) == [row.title for row in ROWS.values()]
    for name, row in ROWS.items():
        assert f"### {row.title}\n{row.text}\n\n`--only {name}`: " in text


def test_marks_say_which_blocks_are_reached() -> None:
    with Coverage("robots.rooms") as found:
        with pytest.raises(FormatError):
            read_room("nothing")
        few = len(found.reached)
        read_room("room 1\nsize 6 4\nbox 1 1 1 1\n")
    assert 0 < few < len(found.reached) < found.blocks
    found.reached.clear()
    read_room("room 1\nsize 6 4\nbox 1 1 1 1\n")
    assert not found.reached


@pytest.mark.parametrize("row", PLANTED)
def test_what_is_switched_off_is_there(row: str) -> None:
    fault = PLANTED[row]
    assert fault.sound in (HOME / fault.path).read_text(encoding="utf-8")
