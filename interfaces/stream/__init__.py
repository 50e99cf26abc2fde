"""The wire protocol: its messages, their encodings, servers and clients."""

from interfaces.stream.codec import LARGEST, Encoding, SharedEncoder, decode, encode
from interfaces.stream.control import PROTOCOL, Notice, ProblemCode, ProtocolError, Question, Role

__all__ = [
    "LARGEST", "PROTOCOL", "Encoding", "Notice", "ProblemCode", "ProtocolError", "Question", "Role",
    "SharedEncoder", "decode", "encode",
]  # fmt: skip
