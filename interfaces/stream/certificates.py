"""TLS at the doors: a server's certificate, made where none is given, and how its clients know it.

What a client goes by stands behind the address: `wss://HOST:PORT#sha256=…` is the certificate's fingerprint,
`#ca=FILE` are authorities of one's own, and without either the system's count.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import hmac
import ipaddress
import os
import re
import ssl
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple
from urllib.parse import urlsplit

from interfaces.system import is_loopback, read_within, write_whole, written
from vrs.clock import seconds_since_1970, utc
from vrs.errors import FormatError, InvalidValueError, VrsError

if TYPE_CHECKING:
    from cryptography import x509

DAY: Final = 86400.0
LIFETIME: Final = 365 * DAY
"""A certificate that is made here counts so long [s],"""
RENEWED: Final = 30 * DAY
"""and another one is made instead at a start that is so near to its end [s]."""
CIPHERS: Final = "ECDHE+AESGCM:ECDHE+CHACHA20"
"""Suites of TLS 1.2: forward secrecy and authenticated encryption. Those of TLS 1.3 all have both."""
_BACKDATED: Final = 3600.0
"""So far the clocks of clients may be behind [s]."""
_BEGIN: Final = b"-----BEGIN CERTIFICATE-----"
_LARGEST: Final = 1 << 20
"""Largest file of certificates [bytes]."""
_PIN: Final = re.compile(r"[0-9a-f]{64}")


class WrongCertificateError(VrsError, ssl.SSLError):
    """A server shows another certificate than its client was told, or one that counts no more."""

    def __init__(self, problem: str) -> None:
        super().__init__(1, problem)
        self.problem = problem

    def __str__(self) -> str:
        return self.problem


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate and its key, in files."""

    chain: Path
    """PEM: the certificate, then those between it and an authority, if there are any."""
    key: Path
    """PEM; it may be the same file."""
    fingerprint: str
    """SHA-256 of the certificate's DER, 64 hexadecimal digits."""
    renewed: bool = False
    """Whether it was made just now."""

    @property
    def shown(self) -> str:
        """The fingerprint as browsers and `openssl x509 -fingerprint -sha256` have it."""
        digits = self.fingerprint.upper()
        return ":".join(digits[k : k + 2] for k in range(0, len(digits), 2))

    def server_context(self, clients: Path | None = None) -> ssl.SSLContext:
        """What a server speaks TLS by: 1.2 or later.

        Args:
            clients: Certificates, or authorities, of those who may come in at all, PEM; None for everybody.

        Raises:
            FormatError: If the key isn't the certificate's, or a file can't be read.
        """
        context = _context(ssl.PROTOCOL_TLS_SERVER, self)
        context.options |= ssl.OP_NO_RENEGOTIATION
        if clients is not None:
            _trust(context, clients)
            context.verify_mode = ssl.CERT_REQUIRED
        return context


class ServerTls:
    """What a server speaks TLS by. Files that have changed count from the next handshake."""

    def __init__(
        self, certificate: Certificate, clients: Path | None = None, *, say: Callable[[str], None] = lambda _: None
    ) -> None:
        """Read the files.

        Args:
            certificate: The server's.
            clients: As of `Certificate.server_context`.
            say: Is told of another certificate, and of one that can't be used: then that from before is shown.

        Raises:
            FormatError: If a file can't be used.
        """
        self._files = tuple(dict.fromkeys((certificate.chain, certificate.key, *([clients] if clients else []))))
        self._certificate, self._clients, self._say = certificate, clients, say
        self._read = self._refused = self._versions()
        self._context = certificate.server_context(clients)

    def context(self) -> ssl.SSLContext:
        """What the next handshake is done by."""
        if (now := self._versions()) != self._read:
            try:
                found = given_certificate(self._certificate.chain, self._certificate.key)
                self._context = found.server_context(self._clients)
            except FormatError as error:
                # Of two files one may not have been written yet: it's tried again.
                if now != self._refused:
                    self._say(f"{error}: the certificate from before is shown")
                self._refused = now
            else:
                self._read = now
                self._say(f"certificate {found.chain} is read again, SHA-256 {found.shown}")
        return self._context

    def _versions(self) -> list[tuple[int, int, int] | None]:
        return [_version(path) for path in self._files]


def _version(path: Path) -> tuple[int, int, int] | None:
    with contextlib.suppress(OSError):
        state = path.stat()
        return state.st_mtime_ns, state.st_ino, state.st_size
    return None


def given_certificate(chain: Path, key: Path) -> Certificate:
    """A certificate of somebody's own.

    Raises:
        FormatError: If a file can't be read, holds something else, or has come to its end.
    """
    found = _read(chain)
    if _has_ended(found):
        raise FormatError(f"certificate {chain}", f"it expired on {_ends(found)}")
    certificate = Certificate(chain, key, hashlib.sha256(found).hexdigest())
    certificate.server_context()
    return certificate


def kept_certificate(path: Path) -> Certificate:
    """A certificate with its key, of a file that was made here.

    Raises:
        FormatError: If it can't be read, or others may read it.
    """
    try:
        mode = path.stat().st_mode & 0o777
    except OSError as error:
        raise FormatError(f"certificate {path}", error.strerror or "can't be read") from None
    if os.name == "posix" and mode != 0o600:
        raise FormatError(f"certificate {path}", f"its mode must be 0600, for the key is in it; it's {mode:04o}")
    return Certificate(path, path, hashlib.sha256(_read(path)).hexdigest())


def own_certificate(path: Path, names: Iterable[str], *, client: bool = False) -> Certificate:
    """The certificate of a file, which is made if it's missing or about to end: self-signed, ECDSA on P-256.

    Args:
        path: Certificate and key, mode 0600; its directory is made, too.
        names: Of the server: what goes into a certificate that is made.
        client: Whether it's a client's.

    Raises:
        FormatError: If it can't be read or made, or others may read it.
    """
    if path.exists():
        kept = kept_certificate(path)
        if not _has_ended(_read(path), RENEWED):
            return kept
    with written(path, "can't be made"):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, _made(sorted(set(names)), client=client), mode=0o600)
    return replace(kept_certificate(path), renewed=True)


def _made(names: list[str], *, client: bool) -> bytes:
    """A key and its certificate, PEM."""
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    key, now = ec.generate_private_key(ec.SECP256R1()), seconds_since_1970()
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "vrs site" if client else "vrs")])
    public = key.public_key()
    usage = ExtendedKeyUsageOID.CLIENT_AUTH if client else ExtendedKeyUsageOID.SERVER_AUTH
    builder = (
        x509.CertificateBuilder(subject, subject, public, x509.random_serial_number())
        .not_valid_before(utc(now - _BACKDATED))
        .not_valid_after(utc(now + LIFETIME))
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.ExtendedKeyUsage([usage]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(public), critical=False)
    )
    if alternative := [_general_name(name) for name in names]:
        builder = builder.add_extension(x509.SubjectAlternativeName(alternative), critical=False)
    pem = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption())
    return pem + builder.sign(key, SHA256()).public_bytes(Encoding.PEM)


def _general_name(name: str) -> x509.GeneralName:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(name))
    except ValueError:
        return x509.DNSName(name.encode("idna").decode("ascii"))


class Peer(NamedTuple):
    """A server as its clients name it."""

    url: str
    """Without what stands behind `#`."""
    context: ssl.SSLContext | None
    """What TLS is spoken by; None where it isn't."""


def server_url(text: str, path: str = "/ws") -> str:
    """The WebSocket's address of a server: `wss://` off loopback, and where a certificate is told, else `ws://`.

    Args:
        text: `HOST:PORT`, or an address by http, https, ws or wss, that of a page with `/` in the end included;
            what its certificate is known by after a `#`.
        path: Where the address has none, or below that page.
    """
    base, hashed, known = text.partition("#")
    scheme, separator, rest = base.partition("://")
    if not separator:
        rest = base
        scheme = "wss" if hashed or not is_loopback(urlsplit(f"//{base}").hostname or "") else "ws"
    scheme = {"http": "ws", "https": "wss"}.get(scheme, scheme)
    if "/" not in rest or rest.endswith("/"):
        rest = rest.rstrip("/") + path
    return f"{scheme}://{rest}{hashed}{known}"


@functools.lru_cache(16)
def peer(url: str, own: Certificate | None = None) -> Peer:
    """How a server is reached, and what it must show.

    Args:
        url: From `server_url`.
        own: What the client shows, where it's asked for a certificate.

    Raises:
        InvalidValueError: If it'd be plain and not on this machine, or what stands behind `#` says nothing.
        FormatError: If a file of authorities can't be read.
    """
    base, _, known = url.partition("#")
    parts = urlsplit(base)
    if parts.scheme != "wss":
        if not is_loopback(parts.hostname or ""):
            hint = " (behind it #sha256= and the fingerprint that the server has printed)"
            raise InvalidValueError("url", base, "wss://… off this machine: no token goes there in plain", hint)
        if known:
            raise InvalidValueError("url", url, "wss:// where a certificate is told behind #")
        return Peer(base, None)
    context = _context(ssl.PROTOCOL_TLS_CLIENT, own)
    kind, _, value = known.partition("=")
    if not known:
        context.load_default_certs()
    elif kind == "ca":
        _trust(context, Path(value))
    elif kind == "sha256" and _PIN.fullmatch(pin := value.replace(":", "").lower()):
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        context.sslobject_class = _pinned(pin)
    else:
        raise InvalidValueError(
            "url", url, "an address, and behind it #sha256= and 64 hexadecimal digits, or #ca=FILE"
        )
    return Peer(base, context)


def _pinned(pin: str) -> type[ssl.SSLObject]:
    """An end of a connection whose handshake fails unless the server's certificate is the one."""

    class Pinned(ssl.SSLObject):
        def do_handshake(self) -> None:
            super().do_handshake()
            shown = self.getpeercert(binary_form=True) or b""
            found = hashlib.sha256(shown).hexdigest()
            if not hmac.compare_digest(found, pin):
                raise WrongCertificateError(f"its certificate is another: sha256={found}, expected sha256={pin}")
            if _has_ended(shown):
                raise WrongCertificateError(f"its certificate expired on {_ends(shown)}")

    return Pinned


def explained(error: Exception, *, tls: bool) -> str:
    """Why there's no connection, in a line.

    Args:
        error: What came.
        tls: Whether TLS was tried.
    """
    if isinstance(error, WrongCertificateError):
        return str(error)
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate doesn't count: {error.verify_message} (or tell its fingerprint, #sha256=…)"
    known = error if isinstance(error, ssl.SSLError) else error.__cause__
    reason = (known.reason or "") if isinstance(known, ssl.SSLError) else ""
    if reason in {"WRONG_VERSION_NUMBER", "RECORD_LAYER_FAILURE", "HTTP_REQUEST"}:
        return "no TLS is spoken there: say ws:// if it's meant to be so"
    if "ALERT" in reason:
        what = reason.lower().replace("_", " ")
        return f"it doesn't take this end's certificate, or its TLS ({what}); see --robot-token-file"
    if type(error).__name__ in {"InvalidMessage", "ConnectionResetError"}:
        # A server that wants a certificate says so behind the handshake, and WebSocket's client doesn't tell.
        robot = "does it ask for a certificate? A robot's is beside its tokens"
        return f"it hung up: {robot if tls else 'does it speak TLS? Say wss://'}"
    return str(error) or type(error).__name__


def _has_ended(certificate: bytes, ahead: float = 0.0) -> bool:
    """Whether a certificate, DER, counts no more so long from now [s]."""
    return _parsed(certificate).not_valid_after_utc.timestamp() <= seconds_since_1970() + ahead


def _context(protocol: int, own: Certificate | None) -> ssl.SSLContext:
    context = ssl.SSLContext(protocol)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    context.set_ciphers(CIPHERS)
    if own is not None:
        try:
            context.load_cert_chain(own.chain, own.key)
        except (OSError, ValueError) as error:
            reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or str(error)
            raise FormatError(f"certificate {own.chain}, key {own.key}", str(reason)) from None
    return context


def _trust(context: ssl.SSLContext, authorities: Path) -> None:
    try:
        context.load_verify_locations(authorities)
    except OSError as error:
        problem = "holds no certificate" if isinstance(error, ssl.SSLError) else error.strerror
        raise FormatError(f"certificates {authorities}", problem or "can't be read") from None


def _read(path: Path) -> bytes:
    """The first certificate of a file, DER."""
    data = read_within(path, _LARGEST)
    begin = data.find(_BEGIN)
    with contextlib.suppress(ValueError):
        if begin >= 0:
            text = data[begin:].partition(b"-----END CERTIFICATE-----")
            return ssl.PEM_cert_to_DER_cert(b"".join(text[:2]).decode("ascii"))
    raise FormatError(f"certificate {path}", "it holds no certificate, PEM")


def _ends(certificate: bytes) -> str:
    """The day on which a certificate, DER, ends."""
    return f"{_parsed(certificate).not_valid_after_utc:%Y-%m-%d}"


def _parsed(certificate: bytes) -> x509.Certificate:
    from cryptography import x509

    return x509.load_der_x509_certificate(certificate)
