"""Hub, router and relays on loopback: viewers at a relay see what the hub does, and nothing comes back by it."""

from __future__ import annotations

import itertools
import json
import time
import urllib.error
import urllib.request

import msgspec
import numpy as np
import pytest

from interfaces import connect
from interfaces.messages import Follow, Pulse, ViewForm
from interfaces.messages.control import Relays, Role, State
from interfaces.relay.mirror import Mirror
from interfaces.relay.network import NetworkConfig
from interfaces.stream.client_socket import UnreachableError
from interfaces.stream.codec import KINDS
from interfaces.stream.meshcat.newest import Nodes
from tests.interfaces.relay.rig import KEY, SITE, endpoint, published, relayed, routing, until
from vrs import JointTarget, MotionCommand
from vrs.clock import ManualClock
from vrs.errors import FormatError, InvalidValueError
from vrs.record import LARGEST

pytestmark = pytest.mark.needs("zenoh")
T = np.linspace(0.0, 60.0, 500)


@pytest.fixture
def network():
    at = endpoint()
    with routing(at) as router:
        yield at, router


def moving(robot, count, label=""):
    """Let the robot go to and fro."""
    poses = [robot.welcome.poses[name] for name in ("ready", "nominal")]
    for k in range(count):
        assert (
            robot.designer.issue(MotionCommand(JointTarget(poses[k % 2]), speed=0.9), wait=5.0).receipt is not None
        )


def same(viewer, robot):
    """Whether a viewer has the timeline that a robot's own viewer has."""
    a, b = viewer.timeline, robot.timeline
    return a is not None and b is not None and len(a) == len(b) and a.end == b.end


def health(serving):
    try:
        with urllib.request.urlopen(f"{serving.url}/health", timeout=5) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.code, json.load(refused)


def state(number, t, q):
    return State(number=number, t=t, q=q, play=t, pace=1.0, D=0.0, following_error=0.0)


def test_a_viewer_at_a_relay_sees_what_the_hub_does_and_when_it_came_too_late(network):
    at, _ = network
    with published(at) as hub, relayed(at) as early, connect(hub.url) as robot:
        own = robot.viewer()
        assert robot.acquire().yours
        moving(robot, 3)
        with relayed(at) as late, connect(early.url, role="viewer") as one, connect(late.url, role="viewer") as two:
            first, second = one.viewer(), two.viewer()
            moving(robot, 3)
            hub.call(hub.hub.show, state(1, robot.now(), robot.welcome.poses["ready"]))
            until(lambda: same(first, own) and same(second, own) and two.state is not None and one.lease.holder)
            for viewer in (first, second):
                # The same bits, not nearly the same.
                assert (viewer.timeline.sample(T) == own.timeline.sample(T)).all()
                assert viewer.timeline.owners(0, 99) == own.timeline.owners(0, 99)
            assert one.lease.holder == "client"
            assert one.lease.epoch is None
            assert one.state.number == 1
            assert one.welcome.instance == robot.welcome.instance
            assert abs(one.now() - robot.now()) < 0.02
            assert health(early)[1]["edit"] == hub.hub.site.look()
            answer = one.observer.ask(wait=5.0)
            assert np.abs(answer.frame.q - own.timeline.sample(answer.frame.t)).max() < 1e-12
            # Each is told where the other one is.
            _, told = early.relay.hub.news[Relays]
            assert told == Relays((f"{late.url}/",))


def test_who_commands_is_sent_to_the_hub_and_tokens_count_at_relays(network):
    at, _ = network
    viewers, operators = "v" * 43, "o" * 43
    tokens = {Role.VIEWER: viewers, Role.OPERATOR: operators}
    with published(at) as hub, relayed(at) as open_to_all, relayed(at, tokens) as closed:
        for relay, token in ((open_to_all, None), (closed, operators)):
            with pytest.raises(UnreachableError, match=f"control is to be had at {hub.url}/"):
                connect(relay.url, token=token)
        with pytest.raises(UnreachableError, match="needs its token"):
            connect(closed.url, role="viewer")
        assert health(closed)[1].keys() == {"ok"}
        for token in (viewers, operators):
            with connect(closed.url, role="viewer", token=token) as one:
                assert one.welcome.role is Role.VIEWER


def test_what_is_lost_is_found_asked_for_and_said(network):
    at, _ = network
    lossy = itertools.cycle([False, False, True])
    losing = [False]
    with (
        published(at, loses=lambda: losing[0] and next(lossy)) as hub,
        relayed(at) as relay,
        connect(hub.url) as robot,
        connect(relay.url, role="viewer") as one,
    ):
        own, seen = robot.viewer(), one.viewer()
        assert robot.acquire().yours
        losing[0] = True
        moving(robot, 20)
        until(lambda: same(seen, own))
        assert (seen.timeline.sample(T) == own.timeline.sample(T)).all()
        assert seen.timeline.owners(0, 999) == own.timeline.owners(0, 999)
        assert health(relay)[1]["gaps"] > 0


def test_a_hub_that_is_gone_is_told_and_another_one_is_begun_with_anew(network):
    at, _ = network
    with relayed(at, ready=False) as relay:
        assert health(relay)[0] == 503
        with pytest.raises(UnreachableError, match="isn't heard"):
            connect(relay.url, role="viewer")
        with published(at, "one") as hub:
            until(lambda: health(relay)[0] == 200)
            with connect(hub.url) as robot, connect(relay.url, role="viewer") as one:
                assert robot.acquire().yours
                moving(robot, 2)
                until(lambda: relay.relay.hub.site.look() == 2)
                hub.end()
                until(lambda: not one.is_connected, 4.0)
                until(lambda: health(relay)[0] == 503)
                with published(at, "two"):
                    until(lambda: one.is_connected)
                    assert one.welcome.instance == "two"
                    viewer = one.viewer()
                    until(lambda: viewer.timeline is not None)
                    assert len(viewer.timeline) == 0
        assert sum("is relayed" in said for said in relay.said) == 2


def test_a_silent_hub_is_stale_and_the_scene_comes_whole(network):
    at, _ = network
    with published(at) as hub:
        hub.call(hub.scene.put_property, "/vrs/virtual", "visible", True)
        with relayed(at) as relay:
            assert not relay.relay.nodes.values
            assert not hub.publisher.health()["scene"]
            place = relay.call(relay.relay.nodes.join)
            until(lambda: len(relay.relay.nodes.values) == 1)
            until(lambda: hub.publisher.health()["scene"])
            for k in range(5):
                hub.call(hub.scene.put_transform, f"/vrs/{k}", np.eye(4))
                hub.call(hub.scene.wake)
            until(lambda: len(relay.relay.nodes.values) == 6)
            assert {key: data for key, (_, data) in relay.relay.nodes.values.items()} == {
                key: data for key, (_, data) in hub.scene.values.items()
            }
            relay.call(relay.relay.nodes.leave, place)
            until(lambda: not hub.publisher.health()["scene"])
            mirror, servlet = relay.relay.mirror, relay.call(relay.relay.hub.site.servlet)
            relay.call(servlet.receive, Follow(1, ViewForm.SEGMENTS), now=relay.call(mirror.clock.now))

            def pulses():
                return [
                    m for m in relay.call(lambda: servlet.advance(now=mirror.clock.now())) if isinstance(m, Pulse)
                ]

            until(pulses)
            hub.call(hub.publisher.turning.stop)
            until(lambda: not mirror.is_current)
            pulses()
            time.sleep(0.2)
            # Pages that get none say that what they show is old.
            assert not pulses()
            assert health(relay)[1]["ok"] is False
            hub.call(hub.publisher.turning.start)
            until(pulses)


def test_when_a_relay_ends_its_programs_go_on_at_another(network):
    at, _ = network
    with published(at) as hub, relayed(at) as other, connect(hub.url) as robot:
        assert robot.acquire().yours
        with relayed(at) as relay:
            one = connect([relay.url, other.url], role="viewer")
            viewer = one.viewer()
            until(lambda: viewer.timeline is not None)
            end = time.monotonic()
            relay.end()
            moving(robot, 1)
            until(lambda: len(viewer.timeline) > 0, 2.0)
            assert time.monotonic() - end < 2.0
        with one:
            until(lambda: health(other)[1]["clients"] == 2)


def test_t20_nothing_on_the_network_commands_a_robot(network):
    at, router = network
    with published(at) as hub, connect(hub.url) as robot:
        assert robot.acquire().yours
        moving(robot, 1)
        before = hub.hub.site.engine.timeline, hub.hub.lease_state, hub.hub.leasing.lease.epoch
        tags = [str(kind.__struct_config__.tag) for kind in KINDS]
        bodies = [
            msgspec.msgpack.encode({"type": tag, "number": 1, "epoch": str(before[2]), "role": "admin"})
            for tag in tags
        ]
        heard = []
        for kind, body in itertools.product(
            (*tags, "timeline", "clock", "facts", "news", "scene", "order"), bodies
        ):
            router.call(router.network.put, f"{KEY}/{kind}", body, "one")
        for kind, body in itertools.product(("timeline", "clock"), bodies):
            router.call(router.network.ask, f"{KEY}/{kind}", body, "one", "eve", lambda *given: heard.append(given))
        time.sleep(0.5)
        assert (hub.hub.site.engine.timeline, hub.hub.lease_state, hub.hub.leasing.lease.epoch) == before
        assert not heard
        assert hub.hub.seats == 1


def test_t21_what_is_malformed_or_of_another_hub_changes_no_relay(network):
    at, router = network
    with published(at) as hub, relayed(at) as relay, connect(relay.url, role="viewer") as one:
        viewer = one.viewer()
        until(lambda: viewer.timeline is not None)
        relay.call(relay.relay.nodes.join)
        until(lambda: hub.publisher.health()["scene"])
        mirror = relay.relay.mirror
        forged = msgspec.msgpack.encode({"type": "pulse", "edit": 9, "now": 1.0, "past": LARGEST})
        router.call(router.network.put, f"{KEY}/timeline", forged, "two")
        kinds = "timeline", "view/scene", "state", "clock", "lease", "whatever"
        order = msgspec.msgpack.encode({"type": "order"})

        def came() -> bool:
            for kind in kinds:
                for body in (b"", b"\xc1", b"\x93" * 5000, order, b"\x81\xa4type\xa5state"):
                    router.call(router.network.put, f"{KEY}/{kind}", body, "one")
            # Where there's no room on the way, some are dropped: they're sent again.
            time.sleep(0.2)
            return mirror.bad >= 30

        until(came)
        assert mirror.gaps == 0
        assert viewer.timeline is not None
        assert relay.relay.mirror is mirror
        hub.call(hub.hub.show, state(1, 0.0, np.zeros(6)))
        until(lambda: one.state is not None)


def test_t21_facts_that_are_none_make_no_mirror():
    for data in (b"", b"\xc1", msgspec.msgpack.encode({"welcome": b"x", "page": {}, "address": ""})):
        with pytest.raises(FormatError):
            Mirror(data, ManualClock(), Nodes())


def test_t22_the_network_is_closed_unless_asked(network, tmp_path):
    at, _ = network
    file = tmp_path / "zenoh.json5"
    file.write_text('{mode: "peer", scouting: {multicast: {enabled: true}}, adminspace: {enabled: true}}')
    for given in (NetworkConfig((at,)), NetworkConfig((at,), file=file)):
        config = given.zenoh()
        assert json.loads(config.get_json("mode")) == "client"
        assert json.loads(config.get_json("listen/endpoints")) == []
        assert json.loads(config.get_json("scouting/multicast/enabled")) is False
        assert json.loads(config.get_json("scouting/gossip/enabled")) is False
        assert json.loads(config.get_json("adminspace/enabled")) is False
    for wrong in (
        "tcp/192.0.2.1:7447",
        "tcp/example.org:7447",
        "udp/127.0.0.1:7447",
        "127.0.0.1:7447",
        "tcp/[::]:1",
    ):
        with pytest.raises(InvalidValueError):
            NetworkConfig((wrong,))
    NetworkConfig(("tls/example.org:7447",))
    with pytest.raises(FormatError):
        NetworkConfig((at,), file=tmp_path / "none").zenoh()


def test_names_of_sites_are_one_part_of_a_key():
    assert KEY == "vrs/bench%201/puma560"
    assert SITE not in KEY
