"""Header, numbers, device map and payloads; laws, and an independent reader."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from interfaces.rsp import header
from interfaces.rsp.errors import PacketError
from interfaces.rsp.header import MODULUS, Header, PacketType, unwrapped, up_to
from interfaces.rsp.layout import Layout, PacketDirection
from interfaces.rsp.model import Effector, MemoryCommand, Module, Monitor, RobotModel, Sensor, example
from tests.memory import values_held

HEADERS = st.builds(
    Header,
    st.integers(0, 65_535), st.booleans(), st.sampled_from(list(PacketType)), st.integers(0, 65_535),
    st.integers(0, 2**32 - 1), st.integers(0, 2**48 - 1), st.integers(0, 65_535), st.integers(0, 255),
)  # fmt: skip
MODEL = example()
LAYOUT = Layout(MODEL)


@given(HEADERS)
def test_a_header_is_20_bytes_in_network_order(head: Header) -> None:
    data = header.encode(head)
    assert len(data) == header.SIZE == 20
    assert header.decode(data) == head
    at, fields = 0, []
    for size in (1, 2, 1, 1, 2, 4, 6, 2, 1):
        fields.append(int.from_bytes(data[at : at + size], "big"))
        at += size
    assert fields == [header.VERSION, *map(int, head)]


@pytest.mark.parametrize(("at", "value"), [(0, 0), (0, 2), (3, 2), (4, 0), (4, 9)])
def test_a_field_that_cant_be_is_refused(at: int, value: int) -> None:
    data = bytearray(header.encode(Header(1, False, PacketType.UP, 0, 0, 0, 0, 0)))
    data[at] = value
    with pytest.raises(PacketError):
        header.decode(bytes(data))


@pytest.mark.parametrize("size", [0, 19, 65_508])
def test_a_length_that_cant_be_is_refused(size: int) -> None:
    with pytest.raises(PacketError, match="length"):
        header.decode(bytes(size))


@given(st.integers(0, 10**9), st.integers(-30_000, 30_000))
def test_a_number_that_is_near_is_found_again(number: int, off: int) -> None:
    near = number + off
    assert unwrapped(number % MODULUS, near) == number
    found = up_to(number % MODULUS, near)
    assert found % MODULUS == number % MODULUS
    assert near - MODULUS < found <= near


@st.composite
def payloads(draw: st.DrawFn, way: PacketDirection) -> dict[int, bytes]:
    """Payloads that a packet of the example may have."""
    found = {}
    for index, size in enumerate(LAYOUT.sizes[way]):
        if size is not None and draw(st.booleans()):
            if size < 0:
                data = draw(st.binary(max_size=256))
                found[index] = struct.pack("!HH", draw(st.integers(0, 65_535)), len(data)) + data
            else:
                found[index] = draw(st.binary(min_size=size, max_size=size))
    return found


@pytest.mark.parametrize("way", PacketDirection)
def test_what_is_joined_is_split_again(way: PacketDirection) -> None:
    @given(payloads(way))
    def law(found: dict[int, bytes]) -> None:
        body = LAYOUT.join(found)
        assert LAYOUT.split(body, way) == found
        assert len(body) == LAYOUT.map_size + sum(map(len, found.values())) <= LAYOUT.longest[way]
        bits = "".join(f"{byte:08b}" for byte in body[: LAYOUT.map_size])
        assert [k for k, bit in enumerate(bits) if bit == "1"] == sorted(found)
        for wrong in (body + b"\0", body[:-1]):
            with pytest.raises(PacketError):
                LAYOUT.split(wrong, way)

    law()


@given(st.binary(max_size=64), st.sampled_from(PacketDirection))
def test_whatever_comes_is_payloads_or_an_error(body: bytes, way: PacketDirection) -> None:
    try:
        found = LAYOUT.split(body, way)
    except PacketError:
        return
    assert LAYOUT.join(found) == body


def test_bits_that_cant_be_are_refused() -> None:
    for bits, way in (
        (b"\x00\x01", PacketDirection.DOWN),
        (b"\x80\x00", PacketDirection.UP),
        (b"\x04\x00", PacketDirection.UP),
    ):
        with pytest.raises(PacketError):
            LAYOUT.split(bits + bytes(12), way)


def test_an_item_is_as_long_as_its_element_at_most() -> None:
    index, longest = MODEL.index("program"), 256
    for size in (0, longest):
        body = LAYOUT.join({index: struct.pack("!HH", 0, size) + bytes(size)})
        assert LAYOUT.split(body, PacketDirection.DOWN)[index][4:] == bytes(size)
    # Longer by a byte, in a packet that may be as long.
    left = MODEL.index("left_wheel")
    for size in (longest + 1, 65_000):
        with pytest.raises(PacketError, match="length"):
            LAYOUT.split(
                LAYOUT.join({left: b"\0\0", index: struct.pack("!HH", 0, size) + bytes(size)}), PacketDirection.DOWN
            )


def test_maps_of_strangers_dont_fill_the_memory() -> None:
    wide = Layout(RobotModel("wide", 1, tuple(Sensor(f"s{k}") for k in range(64))))
    for bits in range(3000):
        wide.split(bits.to_bytes(8, "big"), PacketDirection.DOWN)
    assert values_held(wide) < 5000


def test_sizes_of_each_kind() -> None:
    model = RobotModel(
        "sizes",
        1,
        (
            Effector("a", type="f32", count=3),
            Effector("b", stream=100),
            Monitor("c", "a"),
            Module("d", ("c",)),
            MemoryCommand("e", size=9),
        ),
    )
    layout = Layout(model)
    assert layout.sizes == ((12, 106, 0, 0, -1), (None, None, 12, None, 2))
    assert layout.map_size == 1
    assert layout.longest == (1 + 12 + 106 + 4 + 9, 1 + 12 + 2)
