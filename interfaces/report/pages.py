"""Pages from the templates beside this file; all that a user or a run gives is escaped."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING

from interfaces.lab.claims import interval_said, said
from interfaces.report.tables import number
from vrs.ledger import Status

if TYPE_CHECKING:
    from jinja2 import Environment


def page(name: str, **parts: object) -> str:
    """Render a template; equal parts give equal texts.

    Args:
        name: Of the template.
        parts: What it shows, by the names that it has for them.
    """
    return _templates().get_template(name).render(parts)


@cache
def _templates() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("interfaces.report"),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
        autoescape=True,
    )
    templates.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False}
    templates.filters |= {
        "base64": lambda text: base64.b64encode(text.encode("utf-8")).decode("ascii"),
        "figure": number,
        "interval_said": interval_said,
        "numeric": _numeric,
        "said": said,
    }
    templates.tests["status"] = lambda value: isinstance(value, Status)
    return templates


def _numeric(rows: Sequence[Sequence[object]], columns: int) -> list[bool]:
    """Which columns hold numbers, and what isn't defined, alone."""
    return [
        all(not isinstance(row[i], str) for row in rows) and any(row[i] is not None for row in rows)
        for i in range(columns)
    ]
