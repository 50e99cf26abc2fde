"""Where an arm ends: the tip that is asked for, stated, or stands to reason."""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache
from typing import Final

from robots.description.description import Description, Joint, JointKind
from vrs.checks import did_you_mean
from vrs.errors import InvalidValueError

FINGERS: Final = 3
"""Most joints of a finger: where an arm of as many or more branches into such chains, it has ended."""


def tip_of(description: Description, asked: str = "") -> str:
    """Return the link at the end of an arm.

    Args:
        description: What the robot is.
        asked: The link that is asked for; else the one that's stated beside the file, else that of SRDF's longest
            group, else the end of the one deepest chain, a gripper's fingers not counted.

    Raises:
        InvalidValueError: If there's no such link, no joint on the way to it, or several chains are as deep.
    """
    if asked:
        if asked not in description.links:
            raise InvalidValueError("tip", asked, _choices(description), did_you_mean(asked, description.links))
        if not moving(description, asked):
            raise InvalidValueError("tip", asked, f"a link behind a joint that moves: {_choices(description)}")
        return asked
    if description.tip:
        return description.tip
    lengths = {tip: moving(description, tip) for tip in description.tips.values()}
    longest = [tip for tip, length in lengths.items() if length and length == max(lengths.values())]
    return longest[0] if len(longest) == 1 else _Tree(description).end()


def moving(description: Description, tip: str) -> int:
    """How many joints of their own values there are on the way to a link."""
    return sum(joint.moves for joint in description.chain(tip))


def _choices(description: Description) -> str:
    groups = ", ".join(f"{tip} (group {name})" for name, tip in description.tips.items())
    ends = ", ".join(leaf for leaf in description.leaves() if moving(description, leaf))
    return f"one of {ends or 'none: nothing of it moves'}{'; ' if groups else ''}{groups}, or another link"


class _Tree:
    """A description from its root down."""

    def __init__(self, description: Description) -> None:
        self._description = description
        below: dict[str, list[Joint]] = defaultdict(list)
        for joint in description.joints:
            below[joint.parent].append(joint)
        self._below = below
        self.depth = lru_cache(maxsize=None)(self._depth)

    def _depth(self, joint: Joint) -> int:
        """Most joints that move by themselves from a joint down, itself included."""
        return joint.moves + max(map(self.depth, self._below[joint.child]), default=0)

    def _follows(self, joint: Joint) -> bool:
        """Whether anything moves from a joint down, be it only as another one does."""
        own = joint.kind is not JointKind.FIXED
        return own or any(map(self._follows, self._below[joint.child]))

    def end(self) -> str:
        """The end of the one deepest chain, before the fingers of a gripper.

        Raises:
            InvalidValueError: If there are several as deep, or none.
        """
        link, passed = self._description.root, 0
        while True:
            alive = [joint for joint in self._below[link] if self._follows(joint)]
            deep = [joint for joint in alive if self.depth(joint)]
            if not deep or (passed >= FINGERS and len(alive) > 1 and max(map(self.depth, alive)) <= FINGERS):
                break
            most = max(map(self.depth, deep))
            first = [joint for joint in deep if self.depth(joint) == most]
            # Wheels, a head or a finger beside an arm don't make a second chain of it.
            beside = max((self.depth(joint) for joint in deep if joint not in first), default=0)
            if len(first) > 1 or beside > most // 2:
                raise InvalidValueError(
                    "tip", "", f"given, as there are several chains: {_choices(self._description)}"
                )
            link, passed = first[0].child, passed + first[0].moves
        if not passed:
            raise InvalidValueError(
                "robot", self._description.name, "one with a joint that moves, and follows no other"
            )
        # On to a flange or a tool's frame, while there's just one way.
        while len(self._below[link]) == 1 and self._below[link][0].kind is JointKind.FIXED:
            link = self._below[link][0].child
        return link
