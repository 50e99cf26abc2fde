"""The scene of two mobile robots: what it sends, what it keeps as it is, what it refuses."""

from __future__ import annotations

import base64
import io
from typing import Any

import msgspec
import numpy as np
import pytest
from PIL import Image

from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.meshes import bodies
from interfaces.stream.meshcat.objects import SCREEN_INK
from robots import load
from robots.ipr.shapes import SCREEN_SIZE, screen_pose
from robots.mobile.robot import place
from vrs import DriveCommand, Engine
from vrs.errors import InvalidValueError
from vrs.mobile import Grid

ROBOT = load("ipr")
MODEL = ROBOT.base
LOOKS = bodies(ROBOT)


def told(slot: Any) -> dict[str, dict[str, Any]]:
    """What a viewer is told anew, the newest of each node and kind."""
    found = {}
    while slot:
        for data in slot.take(1 << 30):
            command = msgspec.msgpack.decode(data)
            found[f"{command['path']} {command.get('property', command['type'])}"] = command
    return found


def objects(slot: Any) -> set[str]:
    """Nodes that got another object."""
    return {key.split()[0] for key in told(slot) if key.endswith("set_object")}


def opened(**named: Any) -> tuple[TwinScene, Any]:
    scene = TwinScene(ROBOT, (0.0, 0.0, 0.0), looks=LOOKS, **named)
    slot = scene.join()
    told(slot)
    return scene, slot


def test_robots_stand_where_their_postures_say() -> None:
    scene, slot = opened()
    scene.show(virtual=(1.0, 2.0, 0.5), real=(0.5, 1.5, -2.0), now=0.0)
    found = told(slot)
    assert found["/vrs/real visible"]["value"] is True
    for twin, posture in (("virtual", (1.0, 2.0, 0.5)), ("real", (0.5, 1.5, -2.0))):
        for i, X in enumerate(ROBOT.placed(posture)):
            sent = np.array(found[f"/vrs/{twin}/body/{i} set_transform"]["matrix"]).reshape(4, 4).T
            np.testing.assert_allclose(sent, X, atol=1e-6)


def test_only_the_last_piece_of_a_driven_path_is_sent_again_and_rewinding_hides() -> None:
    scene, slot = opened()
    points = np.column_stack([np.linspace(0, 8, 400), np.zeros(400)])
    scene.show(virtual=(0, 0, 0), driven={"virtual": points[:300]}, now=0.0)
    assert objects(slot) == {f"/vrs/driven/virtual/{k}" for k in range(5)}
    scene.show(virtual=(0, 0, 0), driven={"virtual": points[:310]}, now=1.0)
    assert objects(slot) == {"/vrs/driven/virtual/4"}
    scene.show(virtual=(0, 0, 0), driven={"virtual": points[:65]}, now=2.0)
    found = told(slot)
    assert {key.split()[0][-1] for key in found} == {"1", "2", "3", "4"}
    assert not any(command.get("value", True) for command in found.values())
    scene.show(virtual=(0, 0, 0), driven={"virtual": points[:310]}, now=3.0)
    found = told(slot)
    assert {key.split()[0][-1] for key in found} == {"1", "2", "3", "4"}
    assert all(command.get("value", False) for command in found.values())


def test_the_committed_path_lies_where_the_engine_goes() -> None:
    engine = Engine(MODEL, posture=(0.0, 0.0, 0.0))
    engine.execute(DriveCommand(0.4, 0.3, 2.0))
    scene, slot = opened()
    scene.show(virtual=(0, 0, 0), path=Committed(engine.timeline, 0.25), now=0.0)
    found = told(slot)
    assert {f"/vrs/committed/{k} set_object" for k in range(4)} <= found.keys()
    last = found["/vrs/committed/3 set_object"]["object"]["object"]
    ball = last["children"][2]["matrix"][12:14]
    np.testing.assert_allclose(ball, engine.posture(2.0)[:2], atol=1e-9)


def test_people_walk_and_things_come_and_go_by_the_rooms_time() -> None:
    room = place("fig13_person")
    scene, slot = opened(room=room)
    (person,) = room.people
    scene.show(virtual=(0, 0, 0), t=12.0, now=0.0)
    sent = told(slot)["/vrs/people/0 set_transform"]["matrix"]
    np.testing.assert_allclose(sent[12:14], person.at(12.0), atol=1e-9)
    passing = [i for i, thing in enumerate(room.things, 1) if thing.stands(0.0) != thing.stands(1e6)]
    scene.show(virtual=(0, 0, 0), t=1e6, now=1.0)
    found = told(slot)
    assert {f"/vrs/room/{i} visible" for i in passing} <= found.keys()


def test_a_message_stands_on_the_glass_of_the_real_robot_until_it_is_cleared() -> None:
    scene, slot = opened()
    pictures = []
    for text in (
        "Please put the book on my top side!",
        "Donaudampfschifffahrtselektrizitätenhauptwerk" * 5,
        "ё Ω é",
    ):
        scene.say(text)
        found = told(slot)
        lowered = found["/vrs/real/body/0/screen set_object"]["object"]
        assert found.get("/vrs/real/body/0/screen visible", {"value": True})["value"] is True
        (sheet,), (image,) = lowered["geometries"], lowered["images"]
        assert (sheet["width"], sheet["height"]) == SCREEN_SIZE
        matrix = np.array(lowered["object"]["children"][0]["matrix"]).reshape(4, 4).T
        glass = screen_pose()
        # Before the glass by a hair, its normal outwards and its letters upright.
        np.testing.assert_allclose(matrix[:3, 3] - glass[:3, 3], 0.011 * glass[:3, 0], atol=1e-12)
        np.testing.assert_allclose(matrix[:3, :3], glass[:3, [1, 2, 0]], atol=1e-12)
        data = base64.b64decode(image["url"].removeprefix("data:image/png;base64,"))
        pictures.append(np.asarray(Image.open(io.BytesIO(data))))
    scene.say("")
    assert told(slot)["/vrs/real/body/0/screen visible"]["value"] is False
    for picture in pictures:
        ink = (picture == SCREEN_INK).all(axis=-1)
        rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
        assert 0 < rows[0] < rows[-1] < picture.shape[0] - 1
        assert 0 < columns[0] < columns[-1] < picture.shape[1] - 1
        assert rows[0] + rows[-1] == pytest.approx(picture.shape[0], abs=40)


def test_doors_are_drawn_and_move() -> None:
    room = place("home")
    scene, slot = opened(room=room)
    moves = [k for k, door in enumerate(room.doors) if door.share(61.0) != door.share(0.0)]
    scene.show(virtual=(0, 0, 0), t=61.0, now=0.0)
    found = told(slot)
    assert moves
    for k in moves:
        leaf = room.doors[k].at(61.0)
        sent = found[f"/vrs/doors/{k} set_transform"]["matrix"]
        np.testing.assert_allclose(sent[12:14], (leaf.x, leaf.y), atol=1e-9)
        np.testing.assert_allclose(sent[:2], (np.cos(leaf.angle), np.sin(leaf.angle)), atol=1e-9)


def test_cells_that_were_learned_are_shown_until_they_are_forgotten() -> None:
    scene, slot = opened(grid=Grid((10, 10), 0.1, (1.0, 2.0)))
    scene.show(virtual=(0, 0, 0), learned=((2, 3), (2, 4)), now=0.0)
    assert "/vrs/learned/cells set_object" in told(slot)
    scene.show(virtual=(0, 0, 0), now=1.0)
    assert told(slot)["/vrs/learned/cells visible"]["value"] is False


@pytest.mark.parametrize("named", [{"virtual": (0, 0)}, {"virtual": (0, 0, np.nan)}, {"real": (np.inf, 0, 0)}])
def test_what_is_no_posture_is_refused_and_changes_nothing(named: dict[str, Any]) -> None:
    scene, slot = opened()
    with pytest.raises(InvalidValueError):
        scene.show(**{"virtual": (1.0, 1.0, 1.0), **named}, now=0.0)
    assert told(slot) == {}
