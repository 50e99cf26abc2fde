"""The wire protocol: its messages, their encodings, servers and clients."""

from interfaces.stream.codec import LARGEST, Encoding, SharedEncoder, decode, encode

__all__ = [
    "LARGEST", "Encoding", "SharedEncoder", "decode", "encode",
]  # fmt: skip
