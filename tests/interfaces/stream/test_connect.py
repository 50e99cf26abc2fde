"""`connect`: the four interfaces over real loopback sockets."""

import threading
import time

import numpy as np
import pytest

from interfaces import connect
from interfaces.messages import ViewForm
from interfaces.messages.control import ProblemCode
from interfaces.stream.client_socket import UnreachableError
from tests.interfaces.joined import to
from tests.interfaces.stream.served import ADMIN, HOME, served


@pytest.mark.parametrize("encoding", ["vrs.1.msgpack", "vrs.1.json"])
def test_the_four_interfaces(encoding):
    threads = threading.active_count()
    with served() as serving:
        with connect(f"127.0.0.1:{serving.port}", encoding=encoding, name="tester") as robot:
            assert robot.welcome.robot == "puma560"
            assert robot.acquire().yours
            assert robot.lease.holder == "tester"
            issued = robot.designer.issue(to(1, speed=0.02), execute_in=0.05, wait=5.0)
            assert issued.receipt.status == "accepted"
            assert robot.supervisor.ask(1e3).frame.q.tolist() == serving.hub.site.engine.joints(1e3).tolist()
            assert robot.observer.ask(0.0).frame.q.tolist() == HOME.tolist()
            viewer = robot.viewer(rate=50)
            frames = robot.viewer(rate=60, form=ViewForm.FRAMES)
            compact = robot.viewer(rate=60, form=ViewForm.COMPACT, delay=0.05)
            assert compact.wait(lambda v: len(v.history) > 20)
            assert viewer.wait(lambda v: len(v.history) > 5)
            assert frames.wait(lambda v: len(v.history) > 5)
            engine = serving.hub.site.engine
            for shown in (*viewer.history, *frames.history):
                assert np.abs(shown.q - engine.joints(shown.t)).max() < 1e-9
            for shown in compact.history:
                # The time is rounded, too: to half a microsecond.
                assert np.abs(shown.q - engine.joints(shown.t)).max() < 1e-5
            viewer.pause()
            viewer.seek(0.1)
            assert viewer.next().t == 0.1
            assert abs(robot.now() - serving.server.clock.now()) < robot.clock.uncertainty + 0.05
            assert robot.designer.undo(wait=5.0).refusal == ""
            viewer.close()
            assert robot.release().state == "free"
        until = time.monotonic() + 5.0
        while serving.hub.sessions and time.monotonic() < until:
            time.sleep(0.01)
        assert serving.hub.sessions == ()
        assert serving.hub.seats == 0
    assert threading.active_count() == threads


def test_leaving_gives_the_lease_back():
    with served() as serving:
        with connect(f"http://localhost:{serving.port}") as robot:
            robot.acquire()
        assert serving.hub.robot.log[-1] == ("ended", 1, "released")


def test_an_admin_takes_over():
    with served() as serving:
        url = f"ws://127.0.0.1:{serving.port}/ws"
        with connect(url) as one, connect(url, role="admin", token=ADMIN) as admin:
            assert one.acquire().yours
            assert admin.acquire().code is ProblemCode.LEASE
            assert admin.take_over().yours
            assert one.wait(lambda robot: not robot.lease.yours)
            assert "no lease" in one.designer.issue(to(1), wait=5.0).refusal
            assert one.release().code is ProblemCode.STALE_EPOCH
            assert admin.resume().yours


def test_a_connection_that_is_cut_is_taken_up_again_and_the_lease_stays():
    with served() as serving, connect(f"127.0.0.1:{serving.port}") as robot:
        robot.acquire()
        viewer = robot.viewer(rate=50)
        assert viewer.wait(lambda v: v.timeline is not None)
        for client in list(serving.server.clients.values()):
            serving.loop.call_soon_threadsafe(client.socket.abort)
        issued = [robot.designer.issue(to(k), execute_in=1.0 + k) for k in range(3)]
        found = [robot.designer.answered(one.number, 5.0) for one in issued]
        assert [one.receipt.command_id for one in found] == [1, 2, 3]
        assert robot.lease.epoch == 1
        assert viewer.wait(lambda v: v.timeline is not None and len(v.timeline) >= 9)


def test_who_cannot_be_reached_and_who_is_refused():
    with served() as serving:
        url = f"127.0.0.1:{serving.port}"
        with pytest.raises(UnreachableError, match="token"):
            connect(url, role="admin")
        with pytest.raises(UnreachableError, match="token"):
            connect(url, token="x" * 43)
    with pytest.raises(UnreachableError):
        connect(url, timeout=2.0)
    with pytest.raises(ValueError, match="king"):
        connect(url, role="king")
