"""A recording's tables, and its report."""

from __future__ import annotations

import csv
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from interfaces.cli.main import exit_status
from interfaces.messages import recording as m
from interfaces.recording.export import tables, write_csv, write_parquet
from interfaces.recording.recording import open_recording
from interfaces.report.html import render
from interfaces.runs.summary import summarize, to_json
from tests.interfaces.recording import recorded
from tests.interfaces.recording.taken import MODEL, taken
from vrs import JointTarget, MotionCommand
from vrs.errors import InvalidValueError

NAMES = {"virtual", "real", "commands", "receipts", "segments", "edits", "packets", "link", "events"}
DOC = Path(__file__).resolve().parents[3] / "docs" / "recording.md"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A run that was corrected, with a refused command, and its file."""
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    return taken(path, "tue", seed=2, offset="fixed:0.1"), path


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return np.array([float(row[name]) if row[name] else np.nan for row in rows])


def test_csv_holds_every_float_to_the_last_digit(whole, tmp_path):
    run, path = whole
    with open_recording(path) as recording:
        files = write_csv(tables(recording), tmp_path / "deep" / "csv")
        timeline = recording.timeline
        link = recording.link
    assert {file.stem for file in files} == NAMES
    real, virtual = (read(tmp_path / "deep" / "csv" / f"{name}.csv") for name in ("real", "virtual"))
    k = len(run.t)
    assert (column(real, "t_s")[:k] == run.t).all()
    assert (column(real, "play_s")[:k] == run.play).all()
    for joint in range(6):
        assert (column(real, f"q{joint + 1}_rad")[:k] == run.q_real[:, joint]).all()
        assert (column(real, f"reference{joint + 1}_rad")[:k] == run.q_reference[:, joint]).all()
        assert column(virtual, f"q{joint + 1}_rad")[:k] == pytest.approx(run.q_shown[:, joint], abs=1e-12)
    p = np.stack([column(real, f"{axis}_m") for axis in "xyz"], axis=1)[:k]
    assert (p == MODEL.forward(run.q_real)[:, :3, 3]).all()
    x, y, z, w = (column(real, f"q{name}")[:k] for name in "xyzw")
    assert np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w)], axis=1) == pytest.approx(
        MODEL.forward(run.q_real)[:, :2, 0], abs=1e-12
    )
    segments = read(tmp_path / "deep" / "csv" / "segments.csv")
    assert len(segments) == 6 * len(timeline)
    row, segment = segments[-1], timeline.segments[len(timeline) - 1]
    assert (float(row["start_s"]), float(row["duration_s"])) == (segment.start, segment.duration)
    assert [float(row[name]) for name in ("c0_rad", "c1_rad_per_s", "c2_rad_per_s2")] == [
        *segment.coefficients[:3, 5].tolist(),
        *[0.0] * (3 - len(segment.coefficients[:3])),
    ]
    assert column(read(tmp_path / "deep" / "csv" / "link.csv"), "sent_s") == pytest.approx([e.sent for e in link])


def test_commands_say_what_became_of_them(whole, tmp_path):
    run, path = whole
    with open_recording(path) as recording:
        write_csv(tables(recording), tmp_path)
    rows = read(tmp_path / "commands.csv")
    assert [row["command"] for row in rows].count("correction") == len(run.corrections)
    moves = [row for row in rows if row["command"] == "move"]
    assert [int(row["command_id"]) for row in moves] == [r.command_id for r in run.receipts_virtual]
    assert [row["status"] for row in moves if row["status"] == "rejected"] == ["rejected"]
    assert [row["reason"] for row in rows if row["command"] == "correction"] == [c.reason for c in run.corrections]
    packets = read(tmp_path / "packets.csv")
    assert [(int(row["command_id"]), float(row["sent_s"])) for row in packets] == [
        (packet.command_id, packet.sent) for packet in run.packets
    ]
    events = read(tmp_path / "events.csv")
    assert {(float(row["t_s"]), row["kind"], row["text"]) for row in events} >= {
        (event.t, event.kind, event.text) for event in run.events
    }


def test_receipts_edits_and_packets_are_what_the_run_says(whole, tmp_path):
    run, path = whole
    folder = tmp_path / "csv"
    folder.mkdir()
    (folder / "receipts.csv").write_text("an older one\n" * 1000)
    with open_recording(path) as recording:
        write_csv(tables(recording), folder)
        edits, link = recording.edits, recording.link
    told = read(folder / "receipts.csv")
    for site, receipts in (("virtual", run.receipts_virtual), ("real", run.receipts_real)):
        rows = [row for row in told if row["site"] == site]
        assert [int(row["command_id"]) for row in rows] == [r.command_id for r in receipts]
        assert [row["status"] for row in rows] == [str(r.status) for r in receipts]
        assert [row["reason"] for row in rows] == [r.reason for r in receipts]
        assert [row["superseded_by"] for row in rows] == [shown_as(r.superseded_by) for r in receipts]
        assert [row["undone"] for row in rows] == [str(r.undone).lower() for r in receipts]
        for name in ("issued_at", "asked_at", "execute_at", "end", "shift"):
            assert [row[f"{name}_s"] for row in rows] == [shown_as(getattr(r, name)) for r in receipts]
    moves = [row for row in read(folder / "commands.csv") if row["command"] == "move"]
    for name in ("issued_at", "asked_at"):
        assert [row[f"{name}_s"] for row in moves] == [shown_as(getattr(r, name)) for r in run.receipts_virtual]
    assert [row["q2_rad"] for row in moves] == [
        "" if r.q is None else shown_as(float(r.q[1])) for r in run.receipts_virtual
    ]
    assert all(json.loads(row["content"])["type"] == "move" for row in moves)
    told = read(folder / "edits.csv")
    assert [(int(row["edit"]), row["at_s"], row["end_s"]) for row in told] == [
        (edit.number, shown_as(edit.at), shown_as(edit.timeline.end)) for edit in edits
    ]
    assert [(row["real_id"], row["arrived_s"]) for row in read(folder / "packets.csv")] == [
        (shown_as(packet.real_id), shown_as(packet.arrived)) for packet in run.packets
    ]
    assert [
        (row["direction"], row["arrived_s"], row["lost"], row["attempts"]) for row in read(folder / "link.csv")
    ] == [
        (entry.direction, shown_as(entry.arrived), str(entry.lost).lower(), str(entry.attempts)) for entry in link
    ]
    joints = [row["joint"] for row in read(folder / "segments.csv")]
    assert joints[:7] == ["1", "2", "3", "4", "5", "6", "1"]


def test_what_was_refused_taken_back_lost_or_sent_again_is_told(tmp_path):
    messages, _, _ = recorded.motion(1.5)
    move = MotionCommand(JointTarget(recorded.HOME))
    messages += [
        (1.5, m.CommandRecord(3, 1.5, None, None)),
        (1.5, m.CommandRecord(4, 1.5, move, None, refused=True)),
        (1.5, m.CommandPacket(3, 7, 1.5, 1.6, 5)),
    ]
    path = recorded.write(tmp_path / "run.mcap", messages, end=1.5)
    with open_recording(path) as recording:
        found = {
            table.name: {column.name: column.values for column in table.columns} for table in tables(recording)
        }
    commands, link, packets = (found[name] for name in ("commands", "link", "packets"))
    assert list(zip(commands["command"], commands["refused"], strict=True))[-2:] == [
        ("undo", False),
        ("move", True),
    ]
    rows = zip(link["direction"], link["lost"], link["attempts"], strict=True)
    assert set(rows) == {("forward", False, 1), ("backward", True, 2)}
    assert (packets["command_id"][-1], packets["real_id"][-1], packets["arrived_s"][-1]) == (7, 5, 1.6)


def shown_as(value):
    """A number in a table; nothing where there's none."""
    return "" if value is None else repr(value)


def test_parquet_holds_the_same_with_units(whole, tmp_path):
    from pyarrow import parquet

    _, path = whole
    with open_recording(path) as recording:
        found = tables(recording)
        write_csv(found, tmp_path / "csv")
        files = write_parquet(found, tmp_path / "parquet")
    assert {file.stem for file in files} == NAMES
    for file in files:
        table = parquet.read_table(file)
        rows = read(tmp_path / "csv" / f"{file.stem}.csv")
        assert table.num_rows == len(rows)
        for field in table.schema:
            values = table.column(field.name).to_pylist()
            if str(field.type) == "double":
                given = np.array([np.nan if value is None else value for value in values], float)
                assert np.array_equal(given, column(rows, field.name), equal_nan=True)
            unit = (field.metadata or {}).get(b"unit", b"").decode()
            assert field.name.endswith(f"_{unit.replace('/', '_per_')}" if unit else "")


def test_without_pyarrow_it_says_what_to_install(whole, tmp_path, monkeypatch, capsys):
    _, path = whole
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InvalidValueError, match=r"vrs-teleop\[parquet\]"):
        write_parquet((), tmp_path)
    assert exit_status(["export", str(path), "--parquet", str(tmp_path / "p")]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)


def test_the_report_is_the_runs_own(whole, tmp_path, capsys):
    run, path = whole
    assert exit_status(["export", str(path), "--report", str(tmp_path / "report.html")]) == 0
    assert (tmp_path / "report.html").read_text() == render(run, summarize(run))
    assert capsys.readouterr().out == f"Wrote {tmp_path / 'report.html'}\n"


def test_every_column_is_described(whole):
    _, path = whole
    text = DOC.read_text(encoding="utf-8").split("\n## Export\n")[1]
    with open_recording(path) as recording:
        for table in tables(recording):
            section = text.split(f"| `{table.name}` |", 1)[1].split("\n", 1)[0]
            for name in {re.sub(r"\d+", "N", column.name) for column in table.columns}:
                assert f"`{name}`" in section, (table.name, name)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["export", "{run}"], "--csv DIR, --parquet DIR, --report FILE.html"),
        (["export", "{tmp}/missing", "--csv", "{tmp}"], "missing"),
        (["export", "{tmp}/text", "--csv", "{tmp}"], "text"),
        (["export", "{run}", "--csv", "{tmp}/text"], "can't be written"),
        (["export", "{run}", "--report", "{tmp}/no/r.html"], "can't be written"),
        (["compare", "{tmp}/missing"], "missing"),
        (["compare", "{tmp}/text", "--json"], "text"),
        (["compare", "{run}", "{tmp}/text"], "text"),
        (["compare"], "RUN.mcap"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(whole, tmp_path, capsys, arguments, said):
    (tmp_path / "text").write_text("no recording\n")
    assert exit_status([argument.format(tmp=tmp_path, run=whole[1]) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert captured.err.startswith("vrs: ")
    assert said in captured.err


def test_compare_writes_the_runs_summary_and_sets_another_beside_it(whole, tmp_path, capsys):
    run, path = whole
    other = taken(tmp_path / "other.mcap", "none")
    assert exit_status(["compare", str(path), "--json"]) == 0
    said = capsys.readouterr()
    assert (said.out, said.err) == (to_json(summarize(run)), "")
    assert exit_status(["compare", str(path), str(tmp_path / "other.mcap"), "--json"]) == 0
    value = json.loads(capsys.readouterr().out)
    first, second = (json.loads(to_json(summarize(one))) for one in (run, other))
    assert (value["first"], value["second"]) == (first, second)
    change = second["errors"]["user_time"]["tool_rms_m"] - first["errors"]["user_time"]["tool_rms_m"]
    assert value["differences"]["errors.user_time.tool_rms_m"] == pytest.approx(change, abs=1e-9)
    assert value["differences"]["commands.corrections"] == -len(run.corrections)
    assert exit_status(["compare", str(path), str(tmp_path / "other.mcap")]) == 0
    text = capsys.readouterr().out
    assert "Side by side" in text
    assert f"{1e3 * change:.3f}" in text
    rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in text.splitlines() if "│" in line]
    count = len(run.corrections)
    assert ["corrections", str(count), "0", str(-count), ""] in rows
    assert not {"-0", "-0.000"} & {cell for row in rows if len(row) == 5 for cell in row}


def test_compare_says_what_a_cut_file_lacks(whole, tmp_path, capsys):
    _, path = whole
    data = path.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    assert exit_status(["compare", str(tmp_path / "cut.mcap"), "--json"]) == 0
    said = capsys.readouterr()
    lines = said.err.splitlines()
    assert all(line.startswith("vrs: cut.mcap: missing: ") for line in lines)
    assert "cut" in lines[0].split(": ", 2)[2]
    assert len(json.loads(said.out)["missing"]) == len(lines) > 1
