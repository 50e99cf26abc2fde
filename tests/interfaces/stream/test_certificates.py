"""TLS at real sockets: what is refused, by whom, and what is said."""

from __future__ import annotations

import asyncio
import hashlib
import http.client
import json
import socket
import ssl
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding

from interfaces import connect
from interfaces.cli.main import exit_status
from interfaces.cli.options import certificate_for, names_of
from interfaces.messages.control import Role
from interfaces.stream import certificates
from interfaces.stream.access import Access, make_tokens
from interfaces.stream.certificates import (
    Certificate,
    ServerTls,
    given_certificate,
    own_certificate,
    peer,
    server_url,
)
from interfaces.stream.client_socket import UnreachableError
from interfaces.stream.sockets import SocketLimits
from tests.interfaces import live_rig
from tests.interfaces.stream.served import served
from tests.interfaces.stream.test_stranger import Stranger
from vrs.errors import FormatError, InvalidValueError

NAMES = ("127.0.0.1", "localhost", "::1")


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Certificate:
    return own_certificate(tmp_path_factory.mktemp("tls") / "tls.pem", NAMES)


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Certificate:
    return own_certificate(tmp_path_factory.mktemp("other") / "tls.pem", NAMES)


def address(port: int, certificate: Certificate) -> str:
    return f"wss://127.0.0.1:{port}#sha256={certificate.fingerprint}"


def parsed(certificate: Certificate) -> x509.Certificate:
    return x509.load_pem_x509_certificate(certificate.chain.read_bytes())


def willing() -> ssl.SSLContext:
    """A client that takes whatever it's offered."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    context.set_ciphers("ALL:@SECLEVEL=0")
    return context


def shaken(port: int, context: ssl.SSLContext) -> str:
    """The version and suite that are agreed on."""
    with (
        socket.create_connection(("127.0.0.1", port), 5.0) as plain,
        context.wrap_socket(plain, server_hostname="localhost") as agreed,
    ):
        return f"{agreed.version()} {agreed.cipher()[0]}"


def test_a_certificate_is_made_once_with_its_names_for_a_year_and_its_owner(tmp_path: Path) -> None:
    path = tmp_path / "state" / "tls.pem"
    made = own_certificate(path, [*NAMES, "arm.example"])
    assert made.renewed
    assert path.stat().st_mode & 0o777 == 0o600
    found = parsed(made)
    names = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["arm.example", "localhost"]
    assert {str(one) for one in names.get_values_for_type(x509.IPAddress)} == {"127.0.0.1", "::1"}
    assert found.public_key().curve.name == "secp256r1"
    lasts = found.not_valid_after_utc - found.not_valid_before_utc
    assert 365 <= lasts.days < 366
    assert made.fingerprint == hashlib.sha256(found.public_bytes(Encoding.DER)).hexdigest()
    assert made.shown.replace(":", "").lower() == made.fingerprint
    again = own_certificate(path, NAMES)
    assert (again.fingerprint, again.renewed) == (made.fingerprint, False)


def test_one_that_is_about_to_end_is_made_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "tls.pem"
    monkeypatch.setattr(certificates, "LIFETIME", 29 * certificates.DAY)
    old = own_certificate(path, NAMES)
    monkeypatch.setattr(certificates, "LIFETIME", 31 * certificates.DAY)
    new = own_certificate(path, NAMES)
    assert new.renewed
    assert new.fingerprint != old.fingerprint
    assert own_certificate(path, NAMES).fingerprint == new.fingerprint


def test_t04_a_key_that_others_may_read_isnt_used(tmp_path: Path) -> None:
    path = tmp_path / "tls.pem"
    own_certificate(path, NAMES)
    path.chmod(0o640)
    with pytest.raises(FormatError, match="0600"):
        own_certificate(path, NAMES)


def test_files_that_are_none_are_refused(tmp_path: Path, shown: Certificate, other: Certificate) -> None:
    nothing = tmp_path / "nothing.pem"
    nothing.write_text("no certificate")
    for chain, key in ((nothing, shown.key), (tmp_path / "missing", shown.key), (shown.chain, nothing)):
        with pytest.raises(FormatError):
            given_certificate(chain, key)
    with pytest.raises(FormatError, match="KEY_VALUES_MISMATCH"):
        given_certificate(shown.chain, other.key)


def test_t01_old_versions_and_weak_suites_are_refused(shown: Certificate) -> None:
    with served(tls=shown.server_context()) as serving:
        assert shaken(serving.port, willing()).startswith("TLSv1.3 ")
        for version in (ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1):
            context = willing()
            with pytest.warns(DeprecationWarning, match="TLSv1"):
                context.minimum_version = context.maximum_version = version
            with pytest.raises((ssl.SSLError, ConnectionError)):
                shaken(serving.port, context)
        agreed = []
        for suite in sorted({one["name"] for one in willing().get_ciphers() if one["protocol"] != "TLSv1.3"}):
            context = willing()
            context.set_ciphers(f"{suite}:@SECLEVEL=0")
            context.maximum_version = ssl.TLSVersion.TLSv1_2
            try:
                agreed.append(shaken(serving.port, context))
            except (ssl.SSLError, ConnectionError):
                continue
        assert agreed == [
            "TLSv1.2 ECDHE-ECDSA-AES128-GCM-SHA256",
            "TLSv1.2 ECDHE-ECDSA-AES256-GCM-SHA384",
            "TLSv1.2 ECDHE-ECDSA-CHACHA20-POLY1305",
        ]
        # It has taken all that came before, too.
        assert shaken(serving.port, willing()).startswith("TLSv1.3 ")


@pytest.mark.parametrize("known", ["sha256", "ca"])
def test_clients_come_in_by_fingerprint_and_by_authority(shown: Certificate, known: str, tmp_path: Path) -> None:
    with served(tls=shown.server_context()) as serving:
        authority = tmp_path / "ca.pem"
        authority.write_bytes(ssl.DER_cert_to_PEM_cert(parsed(shown).public_bytes(Encoding.DER)).encode())
        behind = f"sha256={shown.shown}" if known == "sha256" else f"ca={authority}"
        with connect(f"localhost:{serving.port}#{behind}") as robot:
            assert robot.acquire().yours
            assert robot.viewer(rate=50).wait(lambda viewer: len(viewer.history) > 2)


def test_a_stranger_comes_in_by_tls(shown: Certificate) -> None:
    """By the document: the SHA-256 of the certificate's DER is the fingerprint, and the rest is as without TLS."""
    from websockets.sync.client import connect as dial

    with served(tls=shown.server_context()) as serving:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        url = f"wss://127.0.0.1:{serving.port}/ws"
        with dial(url, ssl=context, subprotocols=["vrs.1.msgpack"]) as line:
            certificate = line.socket.getpeercert(binary_form=True)
            assert hashlib.sha256(certificate).hexdigest() == shown.fingerprint
            stranger = Stranger(line)
            stranger.acquire()
            assert stranger.order(type="stop")["receipt"]["status"] == "accepted"


def test_t01_another_certificate_is_refused_at_once_and_after_a_restart(
    shown: Certificate, other: Certificate
) -> None:
    with served(tls=other.server_context()) as serving:
        with pytest.raises(
            UnreachableError, match=rf"sha256={other.fingerprint}, expected sha256={shown.fingerprint}"
        ):
            connect(address(serving.port, shown))
        with pytest.raises(UnreachableError, match="self-signed"):
            connect(f"wss://127.0.0.1:{serving.port}")
    with served(tls=shown.server_context()) as first:
        robot = connect(address(first.port, shown), token=None)
        first.end()
    with robot, served(tls=other.server_context(), port=first.port) as second:
        assert robot.wait(lambda robot: not robot.is_connected)
        assert not robot.wait(lambda robot: robot.is_connected, 2.0)
        assert second.server.clients == {}


def test_one_that_has_ended_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(certificates, "LIFETIME", -1800.0)
    old = own_certificate(tmp_path / "tls.pem", NAMES)
    with pytest.raises(FormatError, match="it expired on"):
        given_certificate(old.chain, old.key)
    with served(tls=old.server_context()) as serving:
        with pytest.raises(UnreachableError, match="its certificate expired on"):
            connect(address(serving.port, old))
        with pytest.raises(UnreachableError, match="certificate has expired"):
            connect(f"wss://127.0.0.1:{serving.port}#ca={old.chain}")


def test_who_speaks_tls_where_none_is_and_the_other_way_round_is_told(shown: Certificate) -> None:
    with served() as serving, pytest.raises(UnreachableError, match="no TLS is spoken there"):
        connect(address(serving.port, shown))
    with (
        served(tls=shown.server_context()) as serving,
        pytest.raises(UnreachableError, match="does it speak TLS"),
    ):
        connect(f"ws://127.0.0.1:{serving.port}")


def test_the_console_says_in_a_line_that_a_certificate_is_another(
    shown: Certificate, other: Certificate, capsys: pytest.CaptureFixture[str]
) -> None:
    with served(tls=other.server_context()) as serving:
        assert exit_status(["console", "--connect", address(serving.port, shown)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "its certificate is another" in said


def test_t01_nothing_goes_off_this_machine_in_plain() -> None:
    assert server_url("127.0.0.1:8600") == "ws://127.0.0.1:8600/ws"
    assert server_url("[::1]:8600") == "ws://[::1]:8600/ws"
    assert server_url("192.0.2.1:8600") == "wss://192.0.2.1:8600/ws"
    assert (
        server_url("https://arm.example/robots/ipr/ws#ca=/a/b.pem") == "wss://arm.example/robots/ipr/ws#ca=/a/b.pem"
    )
    assert server_url("localhost:1#sha256=00", "/site") == "wss://localhost:1/site#sha256=00"
    assert server_url("http://127.0.0.1:8600/") == "ws://127.0.0.1:8600/ws"
    assert server_url("https://arm.example/robots/ipr/#ca=a.pem") == "wss://arm.example/robots/ipr/ws#ca=a.pem"
    for url in ("ws://192.0.2.1:8600", "http://arm.example:8600", "ws://[2001:db8::1]:8600/ws"):
        with pytest.raises(InvalidValueError, match="wss://"):
            connect(url, token="a" * 43)
        assert exit_status(["serve", "--robot-at", url]) == 2
    for wrong in ("wss://arm.example/ws#sha256=12", "wss://arm.example/ws#md5=00", "ws://127.0.0.1/ws#ca=a.pem"):
        with pytest.raises(InvalidValueError):
            peer(wrong)
    with pytest.raises(FormatError):
        peer("wss://arm.example/ws#ca=/missing.pem")


def test_off_loopback_tls_is_usual_and_elsewhere_asked_for(tmp_path: Path, shown: Certificate) -> None:
    tokens = tmp_path / "tokens"
    make_tokens(tokens)

    def made(host: str, **given: object) -> Certificate | None:
        usual = {"tls": None, "chain": None, "key": None}
        return certificate_for(host, tokens, ["lab.example:9000"], **(usual | given))  # type: ignore[arg-type]

    assert made("127.0.0.1") is None
    assert made("192.0.2.1", tls=False) is None
    asked = made("127.0.0.1", tls=True)
    assert asked is not None
    assert asked.chain == tmp_path / "tokens.tls.pem"
    names = parsed(asked).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert {"lab.example", "localhost"} == set(names.get_values_for_type(x509.DNSName))
    usual = made("192.0.2.1")
    assert usual is not None
    assert usual.fingerprint == asked.fingerprint
    given = made("127.0.0.1", chain=shown.chain, key=shown.key)
    assert given is not None
    assert given.fingerprint == shown.fingerprint
    for wrong in (
        {"chain": shown.chain},
        {"key": shown.key},
        {"tls": False, "chain": shown.chain, "key": shown.key},
    ):
        with pytest.raises(InvalidValueError, match="tls-cert"):
            made("127.0.0.1", **wrong)
    assert {"127.0.0.1", "localhost"} < set(names_of("0.0.0.0"))


def test_pages_come_by_https_alone(shown: Certificate) -> None:
    with served(tls=shown.server_context()) as serving:
        for scheme, status in (("https", 200), ("http", 403)):
            line = http.client.HTTPSConnection("127.0.0.1", serving.port, context=willing())
            line.request("GET", "/health", headers={"Origin": f"{scheme}://127.0.0.1:{serving.port}"})
            assert line.getresponse().status == status
            line.close()


def test_t10_handshakes_have_a_deadline_and_give_way(shown: Certificate) -> None:
    limits = SocketLimits(strangers=3, handshake=1.0)
    with served(tls=shown.server_context(), sockets=limits) as serving:
        idle = [socket.create_connection(("127.0.0.1", serving.port), 5.0) for _ in range(4)]
        try:
            begun = time.monotonic()
            assert idle[0].recv(1) == b""
            assert time.monotonic() - begun < 0.9
            with connect(address(serving.port, shown)) as robot:
                assert robot.acquire().yours
            for one in idle[2:]:
                one.sendall(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03")
                assert one.recv(1) == b""
            assert time.monotonic() - begun < 4.0
        finally:
            for one in idle:
                one.close()


def test_a_server_stops_while_somebody_says_farewell(shown: Certificate) -> None:
    """The client has said it, and doesn't close yet, so that TLS isn't over when the server begins to stop."""
    with served(tls=shown.server_context()) as serving:
        plain = socket.create_connection(("127.0.0.1", serving.port), 5.0)
        stream = willing().wrap_socket(plain, server_hostname="localhost")
        stream.sendall(
            b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n"
            b"Sec-WebSocket-Protocol: vrs.1.json\r\n\r\n" % serving.port
        )
        assert b" 101 " in stream.recv(4096)
        stream.sendall(b"\x88\x82\0\0\0\0\x03\xe8")
        time.sleep(0.1)
        closing = threading.Timer(0.3, stream.close)
        closing.start()
    closing.join()


def test_a_robots_health_is_told_to_sites() -> None:
    token = "s" * 43

    def asked(port: int, headers: dict[str, str]) -> dict[str, object]:
        line = http.client.HTTPConnection("127.0.0.1", port, timeout=5.0)
        line.request("GET", "/health", headers=headers)
        found: dict[str, object] = json.load(line.getresponse())
        line.close()
        return found

    async def main() -> None:
        async with live_rig.robot_here(access=Access({Role.SITE: token}, free=())) as (_, url):
            port = int(url.rsplit(":", 1)[1].split("/")[0])
            assert await asyncio.to_thread(asked, port, {}) == {"ok": True}
            known = await asyncio.to_thread(asked, port, {"Authorization": f"Bearer {token}"})
            assert {"q", "robot", "operator"} <= set(known)

    asyncio.run(main())


def test_t02_the_sites_know_each_other_by_certificates(
    shown: Certificate, other: Certificate, tmp_path: Path
) -> None:
    site = own_certificate(tmp_path / "site.pem", (), client=True)
    stranger = own_certificate(tmp_path / "stranger.pem", (), client=True)

    async def met(port: int, server: Certificate, client: Certificate | None) -> str:
        url = f"wss://127.0.0.1:{port}/site#sha256={server.fingerprint}"
        async with live_rig.operator_here(url, certificate=client) as (operator, _):
            await live_rig.until(lambda: operator.robot.attached or operator.robot.problem != "not connected yet")
            return "" if operator.robot.attached else operator.robot.problem

    async def main() -> None:
        async with live_rig.robot_here(tls=shown.server_context(site.chain)) as (_, url):
            port = int(url.rsplit(":", 1)[1].split("/")[0])
            assert await met(port, shown, site) == ""
            assert "its certificate is another" in await met(port, other, site)
            assert "it hung up" in await met(port, shown, None)
            assert "certificate" in await met(port, shown, stranger)

    asyncio.run(main())


def test_a_renewed_certificate_counts_from_the_next_handshake(
    tmp_path: Path, shown: Certificate, other: Certificate
) -> None:
    chain, key, said = tmp_path / "chain.pem", tmp_path / "key.pem", list[str]()

    def write(certificate: Certificate, *files: Path) -> None:
        for file in files:
            file.write_bytes(certificate.chain.read_bytes())

    write(shown, chain, key)
    tls = ServerTls(given_certificate(chain, key), say=said.append)
    with served(shaking=tls.context) as serving:
        with connect(address(serving.port, shown)) as robot:
            write(other, chain)
            # Its key isn't there yet.
            connect(address(serving.port, shown)).close()
            connect(address(serving.port, shown)).close()
            assert len(said) == 1
            assert "the certificate from before is shown" in said[0]
            write(other, key)
            connect(address(serving.port, other)).close()
            assert said[1] == f"certificate {chain} is read again, SHA-256 {other.shown}"
            assert robot.is_connected
        with pytest.raises(UnreachableError, match="its certificate is another"):
            connect(address(serving.port, shown))
        chain.unlink()
        connect(address(serving.port, other)).close()
        assert "No such file" in said[2]


def test_t02_a_site_whose_certificate_was_replaced_comes_in_no_more(tmp_path: Path, shown: Certificate) -> None:
    old = own_certificate(tmp_path / "site.pem", (), client=True)
    kept = replace(old, chain=tmp_path / "old.pem", key=tmp_path / "old.pem")
    kept.chain.write_bytes(old.chain.read_bytes())
    tls = ServerTls(shown, old.chain)
    with served(shaking=tls.context) as serving:

        def asked(own: Certificate) -> int:
            context = willing()
            context.load_cert_chain(own.chain, own.key)
            line = http.client.HTTPSConnection("127.0.0.1", serving.port, context=context)
            try:
                line.request("GET", "/health")
                return line.getresponse().status
            finally:
                line.close()

        assert asked(kept) == 200
        old.chain.unlink()
        new = own_certificate(old.chain, (), client=True)
        assert asked(new) == 200
        with pytest.raises((ssl.SSLError, ConnectionError, http.client.HTTPException)):
            asked(kept)
