"""The wire protocol: its messages, their encodings, servers and clients."""

from interfaces.stream.codec import LARGEST, Encoding, SharedEncoder, decode, encode
from interfaces.stream.control import PROTOCOL, Notice, ProblemCode, Question, Role
from interfaces.stream.errors import ProtocolError

__all__ = [
    "LARGEST", "PROTOCOL", "Encoding", "Notice", "ProblemCode", "ProtocolError", "Question", "Role",
    "SharedEncoder", "decode", "encode",
]  # fmt: skip
