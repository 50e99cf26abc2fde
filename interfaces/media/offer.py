"""A browser's offer, read for what is needed of it and written anew: nothing else of it reaches the connection.

Candidates are left out: the browser finds the server by those of the answer, and no packet goes where it only says.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

from vrs.errors import VrsError

LONGEST: Final = 32_768
"""Characters of an offer at most."""
CODECS: Final = {"video": "VP8/90000", "audio": "opus/48000/2"}
"""What is sent, by kind."""
_MEDIA: Final = re.compile(r"(video|audio) \d{1,5} UDP/TLS/RTP/SAVPF [\d ]{1,400}")
_RTPMAP: Final = re.compile(r"(\d{1,3}) ([A-Za-z0-9/-]{1,32})")
_APT: Final = re.compile(r"(\d{1,3}) apt=(\d{1,3})")
_FIELDS: Final = {
    "mid": re.compile(r"[A-Za-z0-9]{1,16}"),
    "ice-ufrag": re.compile(r"[A-Za-z0-9+/]{4,64}"),
    "ice-pwd": re.compile(r"[A-Za-z0-9+/]{22,128}"),
    "fingerprint": re.compile(r"sha-256 (?:[0-9A-Fa-f]{2}:){31}[0-9A-Fa-f]{2}"),
    "setup": re.compile(r"actpass|active"),
}
"""What every part says of how it's reached, or the offer for all of them."""


class OfferError(VrsError):
    """An offer that can't be answered, or one too many."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"no picture and sound: {problem}")


@dataclass(frozen=True, slots=True)
class _Part:
    """One stream that is asked for."""

    kind: str
    fields: dict[str, str]
    payload: int
    """Type of its packets."""
    again: int | None
    """The same of packets that are sent again; None for no such."""

    def lines(self) -> list[str]:
        """The part as SDP."""
        again = "" if self.again is None else f" {self.again}"
        lines = [f"m={self.kind} 9 UDP/TLS/RTP/SAVPF {self.payload}{again}", "c=IN IP4 0.0.0.0", "a=recvonly"]
        lines += ["a=rtcp-mux", *(f"a={name}:{value}" for name, value in self.fields.items())]
        lines.append(f"a=rtpmap:{self.payload} {CODECS[self.kind]}")
        if self.kind == "video":
            lines += [f"a=rtcp-fb:{self.payload} nack", f"a=rtcp-fb:{self.payload} nack pli"]
        if self.again is not None:
            lines += [f"a=rtpmap:{self.again} rtx/90000", f"a=fmtp:{self.again} apt={self.payload}"]
        return lines


def canonical(offer: str) -> str:
    """Write an offer anew that asks for one video and one audio, in VP8 and Opus.

    Args:
        offer: SDP.

    Returns:
        SDP with the same streams in the same order.

    Raises:
        OfferError: If it asks for anything else, or something that is needed isn't in it.
    """
    if not 1 <= len(offer) <= LONGEST:
        raise OfferError(f"an offer has 1 to {LONGEST} characters")
    common, *parts = re.split(r"^(?=m=)", offer.replace("\r\n", "\n"), flags=re.MULTILINE)
    found = [_read(part.splitlines(), common.splitlines()) for part in parts[:3]]
    if (
        sorted(part.kind for part in found) != ["audio", "video"]
        or found[0].fields["mid"] == found[1].fields["mid"]
    ):
        raise OfferError("one video and one audio can be asked for")
    mids = " ".join(part.fields["mid"] for part in found)
    head = ["v=0", "o=- 1 1 IN IP4 127.0.0.1", "s=-", "t=0 0", f"a=group:BUNDLE {mids}"]
    return "\r\n".join([*head, *(line for part in found for line in part.lines()), ""])


def _read(lines: list[str], common: list[str]) -> _Part:
    media = _MEDIA.fullmatch(lines[0].removeprefix("m="))
    if media is None:
        raise OfferError("only a video and an audio by DTLS can be asked for")
    kind = media[1]
    codec = CODECS[kind].lower()
    payload = next((int(n) for n, name in _matches(lines, "rtpmap", _RTPMAP) if name.lower() == codec), None)
    if payload is None or payload > 127:
        raise OfferError(f"{kind} is sent in {CODECS[kind].partition('/')[0]}")
    again = next((int(n) for n, of in _matches(lines, "fmtp", _APT) if int(of) == payload), None)
    if again is not None and (again > 127 or again == payload or kind == "audio"):
        again = None
    return _Part(kind, {name: _field(name, lines, common) for name in _FIELDS}, payload, again)


def _matches(lines: list[str], name: str, form: re.Pattern[str]) -> list[tuple[str, ...]]:
    """What the attributes of a name say, where they've a form."""
    values = (line.removeprefix(f"a={name}:") for line in lines if line.startswith(f"a={name}:"))
    return [match.groups() for value in values if (match := form.fullmatch(value)) is not None]


def _field(name: str, lines: list[str], common: list[str]) -> str:
    """What a part says, or the offer for all of them."""
    for line in (*lines, *common):
        value = line.removeprefix(f"a={name}:")
        if value != line and _FIELDS[name].fullmatch(value):
            return value
    raise OfferError(f"the offer doesn't say its {name} as it's understood here")
