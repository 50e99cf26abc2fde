"""What stands in a file, read by others: the public MCAP readers, JSON schemas, Foxglove's among them."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import jsonschema
import msgspec
import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Message, Statistics
from mcap.stream_reader import StreamReader

from interfaces.messages import recording as m
from interfaces.messages.fields import rich
from interfaces.recording import RecordingWriter, open_recording
from interfaces.recording.channels import CHANNELS, RecordingChannel
from interfaces.recording.mcap_file import RecordingError
from interfaces.recording.poses import quaternions
from interfaces.recording.writer import encoded
from tests.interfaces.recording import recorded, shown
from vrs.commands import JointTarget, MotionCommand, ParameterChange, PoseTarget, SteerCommand
from vrs.planning.path import rotations

KINDS = ("boolean", "string", "number", "integer", "object", "array")


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    messages, engine, _ = recorded.motion(6.0)
    messages += [
        (6.0, m.Dropped(6.0, (m.Drop("/tf", 3),))),
        (6.0, m.Anchor(
            number=9, at=6.0, initial=recorded.HOME.tolist(), start=0.0,
            version=2, end=7.0, error=[0.0] * 6, reason="apart",
            segments=engine.timeline.segments[:],
        )),
        (6.0, m.CommandRecord(10, 6.0, None, None)),
        (6.0, m.CommandRecord(11, 6.0, ParameterChange("speed", 0.5), None, refused=True)),
        (6.0, m.CommandRecord(12, 6.0, MotionCommand(PoseTarget(np.eye(4)), deviation=np.inf), None)),
        (6.0, m.CommandRecord(13, 6.0, SteerCommand(twist=np.zeros(6)), None)),
        (6.0, recorded.history(engine, 7)),
    ]  # fmt: skip
    return recorded.write(tmp_path_factory.mktemp("format") / "run.mcap", messages, end=6.0)


def test_the_public_readers_accept_a_file(path: Path) -> None:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "vrs-recording/1"
        seen = [(channel.topic, message.log_time) for _, channel, message in reader.iter_messages()]
        summary = reader.get_summary()
        assert summary is not None
        statistics = summary.statistics
        assert statistics is not None
    assert {topic for topic, _ in seen} == {
        channel.topic for channel in CHANNELS if channel.arm and not channel.rare
    }
    times = [t for _, t in seen]
    assert times == sorted(times)
    with path.open("rb") as file:
        records = list(StreamReader(file, validate_crcs=True).records)
    counts: dict[int, int] = {}
    for record in records:
        if isinstance(record, Message):
            counts[record.channel_id] = counts.get(record.channel_id, 0) + 1
    assert counts == statistics.channel_message_counts
    assert sum(counts.values()) == statistics.message_count == len(seen)
    assert (statistics.message_start_time, statistics.message_end_time) == (0, 6 * 10**9)
    assert sum(isinstance(record, Statistics) for record in records) == 1


def test_one_channel_alone_can_be_read_by_the_index(path: Path) -> None:
    with path.open("rb") as file:
        seen = [
            message.log_time for *_, message in make_reader(file).iter_messages("/commands", starting_at=2 * 10**9)
        ]
    with path.open("rb") as file:
        slow = [message.log_time for *_, message in NonSeekingReader(file).iter_messages("/commands")]
    assert seen == [t for t in slow if t >= 2 * 10**9]
    assert seen


def test_every_message_keeps_to_its_schema(path: Path) -> None:
    seen, validators = set(), {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            if schema.name not in validators:
                validators[schema.name] = jsonschema.Draft202012Validator(json.loads(schema.data))
            value = json.loads(message.data)
            validators[schema.name].validate(value)
            seen.add((channel.topic, value.get("kind")))
    kinds = {(c.topic, k.__struct_config__.tag) for c in CHANNELS for k in c.arm if not c.rare}
    assert {(topic, kind) for topic, kind in kinds if topic != "/events"} <= seen


@pytest.mark.parametrize("robot", ["arm", "mobile"])
@pytest.mark.parametrize("channel", CHANNELS, ids=lambda channel: channel.topic)
def test_a_schema_says_what_foxglove_can_read(channel, robot) -> None:
    """Its reader throws on anything but objects with properties, and lists of simple values or of objects."""

    def check(schema) -> None:
        assert schema["type"] in KINDS
        if schema["type"] == "object":
            for one in schema["properties"].values():
                check(one)
        elif schema["type"] == "array":
            assert schema["items"]["type"] != "array"
            check(schema["items"])

    if not (kinds := getattr(channel, robot)):
        return
    schema = json.loads(channel.json_schema(kinds))
    assert schema["type"] == "object"
    assert schema["title"] == channel.schema
    check(schema)
    jsonschema.Draft202012Validator.check_schema(schema)


class _Share(msgspec.Struct):
    """A number within whole bounds."""

    share: Annotated[float, msgspec.Meta(ge=0, le=1)]


def test_bounds_of_numbers_are_written_in_one_way() -> None:
    """Of two that are equal, typing knows the first that was written: a file would hang on the order of imports."""
    channel = RecordingChannel("/share", "vrs.Share", (_Share,), ())
    assert b'"minimum":0.0,"maximum":1.0' in channel.json_schema((_Share,))


def test_a_schema_refuses_what_is_no_such_message() -> None:
    (channel,) = (channel for channel in CHANNELS if channel.topic == "/real/joints")
    schema = json.loads(channel.json_schema(channel.arm))
    jsonschema.validate({"t": 1.0, "play": 0.5, "q": [1.0]}, schema)
    for wrong in ({"t": 1.0, "q": [1.0]}, {"t": 1.0, "play": 0.5, "q": ["x"]}, {"t": "1", "play": 0, "q": [1]}):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate(wrong, schema)


def test_foxgloves_links_are_the_robots(path: Path) -> None:
    with path.open("rb") as file:
        *_, message = next(make_reader(file).iter_messages("/tf", starting_after=2 * 10**9))
    transforms = json.loads(message.data)["transforms"]
    t = shown.seconds(transforms[0]["timestamp"])
    assert t == pytest.approx(1e-9 * message.log_time, abs=1e-9)
    with open_recording(path) as recording:
        links = recorded.MODEL.links(recording.virtual(t))
    poses = shown.links(transforms)
    assert len(poses) == 2 * len(links)
    for number, link in enumerate(links, 1):
        np.testing.assert_allclose(poses[f"virtual/{number}"], link, atol=2e-5)


def test_quaternions_turn_as_their_matrices() -> None:
    turns = np.vstack([np.random.default_rng(0).normal(size=(200, 3)), np.pi * np.eye(3), np.zeros((1, 3))])
    R = rotations(turns)
    x, y, z, w = quaternions(R).T
    back = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]).transpose(2, 0, 1)  # fmt: skip
    np.testing.assert_allclose(back, R, atol=1e-12)
    assert (w >= 0).all()


def test_numbers_come_back_to_the_last_bit(path: Path) -> None:
    with open_recording(path) as recording:
        track = recording.track("/real/joints")
    assert [row.tobytes() for row in track.q] == [
        np.array(recorded.sample(k).q).tobytes() for k in range(len(track.t))
    ]
    assert track.t.tolist() == [k * recorded.STEP for k in range(361)]


def test_a_receipt_names_all_that_it_shifted() -> None:
    names = tuple(range(1, 3001))
    receipt = recorded.motion(0.1)[1].receipts[0]
    entry = m.ReceiptEntry(0.1, "real", dataclasses.replace(receipt, shifted_names=lambda: names).named())
    back = msgspec.json.decode(encoded(entry)[1], type=m.ReceiptEntry, dec_hook=rich)
    assert back.receipt.shifted == names


def test_the_same_messages_make_the_same_bytes_whatever_the_hash_seed(tmp_path: Path) -> None:
    code = (
        "import sys; from pathlib import Path; from tests.interfaces.recording import recorded;"
        "recorded.write(Path(sys.argv[1]), recorded.motion(1.0)[0], end=1.0)"
    )
    written = []
    for seed in ("1", "2"):
        path = tmp_path / seed
        subprocess.run(
            [sys.executable, "-c", code, path],
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": ":".join(sys.path)},
            check=True,
        )
        written.append(path.read_bytes())
    assert written[0] == written[1]


def test_blocks_are_short_and_the_beginning_comes_again(tmp_path: Path) -> None:
    path = recorded.write(
        tmp_path / "run.mcap", [(0.05 * k, recorded.sample(k, 0.05)) for k in range(500)], end=25.0
    )
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
        spans = [index.message_end_time - index.message_start_time for index in summary.chunk_indexes]
        begins = [message.log_time for *_, message in make_reader(file).iter_messages("/session")]
    assert max(spans) < 0.25e9
    assert begins == [0, 10_000_000_000, 20_000_000_000, 25_000_000_000]


def test_a_large_message_closes_its_block(tmp_path: Path) -> None:
    engine = recorded.motion(0.1)[1]
    large = m.HistoryEntry(
        edit=0, at=0.0, version=0, initial=[0.0] * 6, start=0.0, total=0, index=0,
        segments=engine.timeline.segments[:] * 200,
    )  # fmt: skip
    path = recorded.write(tmp_path / "run.mcap", [(0.0, large)] * 30, end=0.0)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
        assert summary is not None
    assert len(summary.chunk_indexes) > 3
    assert max(index.uncompressed_size for index in summary.chunk_indexes) < 3 * 2**20


def test_nothing_is_written_after_the_end(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "run.mcap", recorded.begin())
    writer.finish(m.End(0.0))
    with pytest.raises(RecordingError, match="finished"):
        writer.write(recorded.sample(0), t=0.0)


def test_commands_come_back(path: Path) -> None:
    with open_recording(path) as recording:
        entries = [entry for entry in recording.commands if isinstance(entry, m.CommandRecord)]
        anchor = next(entry for entry in recording.commands if isinstance(entry, m.Anchor))
    first = entries[0].command
    assert isinstance(first, MotionCommand)
    assert isinstance(first.target, JointTarget)
    assert entries[-4].command is None
    assert entries[-3].refused
    assert entries[-2].command.deviation == np.inf
    assert anchor.truth == recorded.motion(6.0)[1].timeline
