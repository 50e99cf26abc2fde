"""A program under a lease that its person has on a page: nothing of it goes on once the page has commanded."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.messages import control
from tests.interfaces.joined import to
from tests.interfaces.val2.shared import Pair
from vrs.commands import SteerCommand, Stop

LOOP = ("EDIT loop", "10 DRIVE 1,30,50", "DRIVE 1,-30,50", "DRIVE 6,40,80", "DRIVE 6,-40,80", "GOTO 10", "E")
BROKEN = ("EDIT loop", "10 DRIVE 1,30,50", "BREAK", "DELAY 0.2", "DRIVE 1,-30,50", "GOTO 10", "E")

STEER = SteerCommand(rates=[0.1, 0, 0, 0, 0, 0])


def stands(pair, seconds=1.0):
    """Whether the virtual robot stands still from now on."""
    t = pair.joined.now
    pair.run(seconds)
    q = np.array([pair.engine.joints(x) for x in np.linspace(t, pair.joined.now, 50)])
    return np.abs(q - q[0]).max() < 1e-9


def test_a_command_takes_control_for_the_page_and_gives_it_back_to_nobody(tmp_path):
    pair = Pair(tmp_path)
    pair.type("WHERE")
    assert not pair.holds
    assert "*" not in pair.type("DO DRIVE 1,10,50")
    assert (pair.holds, pair.val.lease.shared) == (True, True)
    pair.monitor.leave(now=pair.joined.now)
    pair.run(0.2)
    assert pair.holds
    assert not pair.val.lease.commands
    assert [kind for kind, *_ in pair.joined.hub.robot.log] == ["began"]


@pytest.mark.parametrize("lines", [LOOP, BROKEN], ids=["continuous", "with pauses"])
@pytest.mark.parametrize("command", [Stop(), to(3), STEER, None], ids=["stop", "move", "steer", "undo"])
def test_what_the_page_commands_ends_the_program_and_its_motions(tmp_path, lines, command):
    for k in range(4):
        pair = Pair(tmp_path)
        pair.type(*lines, "EXECUTE loop, -1")
        pair.run(0.8 + 0.337 * k)
        assert pair.controller.running
        pair.said = ""
        before = pair.page.undo() if command is None else pair.page.issue(command)
        pair.run(0.1)
        assert not pair.controller.running
        assert pair.said.count("*Motion interrupted*") == 1, pair.said
        assert pair.said.count("*") == 2
        receipt = pair.page.issued(before.number).receipt
        assert receipt.status != "rejected"
        # A page's move that's spliced in takes a while, and leads back to where the program's next one began.
        pair.run(1.5)
        pair.run(max(0.0, pair.engine.timeline.end - pair.joined.now))
        assert stands(pair)
        later = {s.command_id for s in pair.engine.timeline.segments if s.start > before.issued_at + 0.3}
        if command is not None:
            assert later <= {receipt.command_id, None}
        if isinstance(command, Stop):
            assert pair.engine.newest == receipt.command_id
        assert pair.holds


def test_after_a_stop_retry_goes_on_and_commands_do(tmp_path):
    pair = Pair(tmp_path)
    pair.type(*LOOP, "EXECUTE loop, -1")
    pair.run(1.3)
    pair.page.issue(Stop())
    pair.run(1.0)
    assert stands(pair)
    assert "*" not in pair.type("DO DRIVE 5,10,50")
    pair.type("RETRY")
    assert pair.controller.running
    assert not stands(pair)
    pair.page.issue(Stop())
    pair.run(0.1)
    assert not pair.controller.running


def test_a_lease_that_ends_ends_the_program(tmp_path):
    pair = Pair(tmp_path)
    pair.type(*LOOP, "EXECUTE loop, -1")
    pair.run(1.3)
    pair.page.release()
    pair.run(0.1)
    assert not pair.controller.running
    assert "*Motion interrupted* control has ended" in pair.said
    newest = pair.engine.newest
    pair.run(1.0)
    assert pair.engine.newest == newest
    other = pair.joined.client(name="Bea")
    pair.joined.run(0.5)
    assert pair.joined.wish(other, control.Acquire).yours
    assert "*No control* RETRY: Bea has control" in pair.type("RETRY")
    assert pair.engine.newest == newest
