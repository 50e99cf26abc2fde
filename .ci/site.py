"""What the site of the documentation needs beside MkDocs: pages by pattern, and the commands' own help."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

log = logging.getLogger("mkdocs.hooks.site")

COMMANDS = "reference/commands.md"
"""The page that ends with each command's help."""


def on_config(config: Any) -> Any:
    """Put pages in the place of the patterns in the navigation."""
    named = set(_leaves(config.nav))
    config.nav = _expanded(config.nav, named, Path(config.docs_dir))
    return config


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Append the help of every command to their page."""
    return markdown + "\n" + "\n".join(_helps()) if page.file.src_uri == COMMANDS else markdown


def on_post_page(output: str, page: Any, **_: Any) -> str:
    """Warn, which ends a strict build, of a page that would load something from elsewhere."""
    for found in re.findall(r'(?:<link[^>]*href|src)="(https?://[^"]+)"', output):
        log.warning("%s would load %s", page.file.src_uri, found)
    return output


def _leaves(nav: Any) -> Iterator[str]:
    if isinstance(nav, str):
        yield nav
    else:
        for item in nav.values() if isinstance(nav, dict) else nav:
            yield from _leaves(item)


def _expanded(nav: Any, named: set[str], docs: Path) -> Any:
    if isinstance(nav, dict):
        return {title: _expanded(item, named, docs) for title, item in nav.items()}
    if not isinstance(nav, list):
        return nav
    made = []
    for item in nav:
        if isinstance(item, str) and "*" in item:
            found = (path.relative_to(docs).as_posix() for path in sorted(docs.glob(item)))
            made.extend(page for page in found if page not in named)
        else:
            made.append(_expanded(item, named, docs))
    return made


def _helps() -> Iterator[str]:
    import typer

    from interfaces.cli.main import app

    yield from _help(typer.main.get_command(app), "vrs", 0)


def _help(command: Any, name: str, depth: int) -> Iterator[str]:
    if depth:
        yield f"{'#' * (depth + 1)} `{name}`\n"
    context = command.make_context(name, [], resilient_parsing=True)
    yield f"{command.help or ''}\n"
    if not hasattr(command, "commands"):
        usage = " ".join(command.collect_usage_pieces(context))
        yield f"    {name} {usage}\n"
        yield from _options(command, context)
    for child, inner in sorted(getattr(command, "commands", {}).items()):
        yield from _help(inner, f"{name} {child}", depth + 1)


def _options(command: Any, context: Any) -> Iterator[str]:
    rows = [row for parameter in command.get_params(context) if (row := parameter.get_help_record(context))]
    yield "| | |"
    yield "|---|---|"
    for flag, text in rows:
        yield f"| `{_cell(flag)}` | {_cell(text)} |"
    yield ""


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")
