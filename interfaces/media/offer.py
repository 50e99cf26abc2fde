"""A browser's offer, read for what is needed of it and written anew: nothing else of it reaches the connection.

Candidates are left out: the browser finds the server by those of the answer, and no packet goes where it only says.
"""

from __future__ import annotations

import re
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
    if sorted(kind for kind, _, _ in found) != ["audio", "video"] or found[0][1] == found[1][1]:
        raise OfferError("one video and one audio can be asked for")
    mids = " ".join(mid for _, mid, _ in found)
    head = ["v=0", "o=- 1 1 IN IP4 127.0.0.1", "s=-", "t=0 0", f"a=group:BUNDLE {mids}"]
    return "\r\n".join([*head, *(line for _, _, lines in found for line in lines), ""])


def _read(lines: list[str], common: list[str]) -> tuple[str, str, list[str]]:
    """One stream that is asked for: its kind, its mid, and its lines as they're written anew."""
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
    fields = {name: _field(name, lines, common) for name in _FIELDS}
    types = f"{payload}" if again is None else f"{payload} {again}"
    anew = [f"m={kind} 9 UDP/TLS/RTP/SAVPF {types}", "c=IN IP4 0.0.0.0", "a=recvonly", "a=rtcp-mux"]
    anew += [f"a={name}:{value}" for name, value in fields.items()]
    anew.append(f"a=rtpmap:{payload} {CODECS[kind]}")
    if kind == "video":
        anew += [f"a=rtcp-fb:{payload} nack", f"a=rtcp-fb:{payload} nack pli"]
    if again is not None:
        anew += [f"a=rtpmap:{again} rtx/90000", f"a=fmtp:{again} apt={payload}"]
    return kind, fields["mid"], anew


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
