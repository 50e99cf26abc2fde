"""Offers are written anew from what is needed of them, or refused; nothing else comes through."""

from __future__ import annotations

import random
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from interfaces.media.offer import LONGEST, OfferError, canonical

PRINT = ":".join(["AB"] * 32)
COMMON = (
    "v=0\r\no=- 4611731400430051336 2 IN IP4 127.0.0.1\r\ns=-\r\nt=0 0\r\n"
    "a=group:BUNDLE 0 1\r\na=extmap-allow-mixed\r\n"
)
REACHED = (
    f"a=ice-ufrag:bUVc\r\na=ice-pwd:{'x' * 24}\r\na=ice-options:trickle\r\n"
    f"a=fingerprint:sha-256 {PRINT}\r\na=setup:actpass\r\n"
)
VIDEO = (
    "m=video 51234 UDP/TLS/RTP/SAVPF 96 97 102 103\r\nc=IN IP4 192.0.2.7\r\na=rtcp:9 IN IP4 0.0.0.0\r\n"
    "a=candidate:1 1 udp 2113937151 192.0.2.7 51234 typ host\r\n"
    + REACHED
    + "a=mid:0\r\na=recvonly\r\na=rtcp-mux\r\n"
    "a=rtpmap:102 H264/90000\r\na=rtpmap:96 VP8/90000\r\na=rtpmap:97 rtx/90000\r\na=fmtp:97 apt=96\r\n"
    "a=rtpmap:103 rtx/90000\r\na=fmtp:103 apt=102\r\n"
)
AUDIO = (
    "m=audio 9 UDP/TLS/RTP/SAVPF 111 63\r\nc=IN IP4 0.0.0.0\r\n" + REACHED + "a=mid:1\r\na=recvonly\r\n"
    "a=rtpmap:111 opus/48000/2\r\na=fmtp:111 minptime=10;useinbandfec=1\r\na=rtpmap:63 red/48000/2\r\n"
)
OFFER = COMMON + VIDEO + AUDIO


def test_streams_keep_their_order_their_numbers_and_their_secrets() -> None:
    for parts, kinds in (((VIDEO, AUDIO), ["video", "audio"]), ((AUDIO, VIDEO), ["audio", "video"])):
        found = canonical(COMMON + "".join(parts))
        assert re.findall(r"^m=(\w+)", found, re.MULTILINE) == kinds
        mids = re.findall(r"^a=mid:(\w+)", found, re.MULTILINE)
        assert f"a=group:BUNDLE {' '.join(mids)}\r\n" in found
        assert "m=video 9 UDP/TLS/RTP/SAVPF 96 97\r\n" in found
        assert "m=audio 9 UDP/TLS/RTP/SAVPF 111\r\n" in found
        assert found.count(PRINT) == found.count("bUVc") == 2
        assert canonical(found) == found


def test_where_it_says_it_is_reached_is_left_out() -> None:
    found = canonical(OFFER)
    assert "192.0.2.7" not in found
    assert "candidate" not in found
    assert "H264" not in found


def test_what_is_said_for_all_parts_counts_for_each() -> None:
    shared = COMMON + REACHED + VIDEO.replace(REACHED, "") + AUDIO.replace(REACHED, "")
    assert canonical(shared) == canonical(OFFER)


def test_what_a_part_says_counts_before_what_is_said_for_all() -> None:
    assert canonical(COMMON + REACHED.replace("bUVc", "else") + VIDEO + AUDIO) == canonical(OFFER)


@pytest.mark.parametrize("number", [96, 128, 999])
def test_packets_that_are_sent_again_have_a_type_of_their_own_or_there_are_none(number: int) -> None:
    video = VIDEO.replace(":97 ", f":{number} ")
    found = canonical(COMMON + video + AUDIO)
    assert "m=video 9 UDP/TLS/RTP/SAVPF 96\r\n" in found
    assert "rtx" not in found


@pytest.mark.parametrize(
    "offer",
    [
        "",
        "v=0\r\n",
        "x" * (LONGEST + 1),
        COMMON + VIDEO,
        COMMON + VIDEO + VIDEO,
        COMMON + VIDEO + AUDIO + AUDIO,
        OFFER.replace("VP8", "VP9"),
        OFFER.replace("a=mid:1", "a=mid:0"),
        OFFER.replace("a=mid:1", "a=mid:../1"),
        OFFER.replace("sha-256", "md5"),
        OFFER.replace("bUVc", "b"),
        OFFER.replace("setup:actpass", "setup:holdconn"),
        OFFER.replace("rtpmap:96", "rtpmap:196"),
        OFFER.replace("rtpmap:111", "rtpmap:128"),
        COMMON + VIDEO + "m=application 9 UDP/DTLS/SCTP webrtc-datachannel\r\n" + REACHED,
    ],
)
def test_anything_else_is_refused(offer: str) -> None:
    with pytest.raises(OfferError):
        canonical(offer)


@given(st.integers(0, 2**32))
def test_a_broken_offer_is_refused_or_as_good_as_whole(seed: int) -> None:
    rng, lines = random.Random(seed), OFFER.split("\r\n")
    for _ in range(rng.randint(1, 4)):
        i = rng.randrange(len(lines))
        match rng.randrange(4):
            case 0:
                lines[i] = lines[i][: rng.randint(0, len(lines[i]))]
            case 1:
                lines.insert(i, lines[rng.randrange(len(lines))])
            case 2:
                j = rng.randint(0, len(lines[i]))
                lines[i] = lines[i][:j] + rng.choice("0 :/=é\x00\n9") + lines[i][j + 1 :]
            case _:
                rng.shuffle(lines)
    try:
        found = canonical("\r\n".join(lines))
    except OfferError:
        return
    assert len(found) < 2000
    assert canonical(found) == found
    assert re.fullmatch(r"(?:[vostcma]=[ -~]*\r\n)+", found)
