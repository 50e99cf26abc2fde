"""Every value that crosses or is stored, and how it's written; a module for each kind of parties."""

from interfaces.messages.requests import (
    Answer,
    Ask,
    Broadcast,
    Change,
    Compact,
    Follow,
    Frame,
    FrameStatus,
    FrameVerdict,
    History,
    Order,
    Outcome,
    Pulse,
    Refusal,
    RefusalCode,
    Reply,
    Request,
    Scene,
    Verdicts,
    ViewForm,
    Want,
)  # fmt: skip

__all__ = [
    "Answer", "Ask", "Broadcast", "Change", "Compact", "Follow", "Frame", "FrameStatus", "FrameVerdict", "History",
    "Order", "Outcome", "Pulse", "Refusal", "RefusalCode", "Reply", "Request", "Scene", "Verdicts", "ViewForm",
    "Want",
]  # fmt: skip
