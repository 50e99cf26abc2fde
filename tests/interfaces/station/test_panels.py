"""Panels follow from what a server has."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import interfaces.station
from interfaces.station.panels import PANELS, Offer, Panel, panels_of
from vrs.errors import InvalidValueError

ARM = """pane drag link control theme hints stop jog receipts plots terminal network record strip"""
STATIC = Path(interfaces.station.__file__).parent / "static"
BASE = """floor link control theme hints stop drive map jobs camera plots network record"""


def test_a_page_has_the_panels_of_what_its_server_offers_in_one_order() -> None:
    assert [p.name for p in panels_of({Offer.POLYNOMIALS, Offer.TERMINALS, Offer.RECORDINGS})] == ARM.split()
    everything = {Offer.ARCS, Offer.JOBS, Offer.CAMERA, Offer.RECORDINGS}
    assert [p.name for p in panels_of(everything)] == BASE.split()
    bare = {p.name for p in panels_of({Offer.ARCS})}
    assert {"floor", "drive", "plots"} <= bare
    assert not bare & {"map", "jobs", "camera", "record"}


def test_every_panel_can_be_had_and_its_name_is_a_files() -> None:
    assert set(panels_of(set(Offer))) == set(PANELS)
    with pytest.raises(InvalidValueError, match="small letters"):
        Panel("../x", "Elsewhere", "side")


def test_every_symbol_that_is_named_has_an_outline() -> None:
    outlines = set(re.findall(r"^  (\w+): \"", (STATIC / "icons.js").read_text(), re.MULTILINE))
    scripts = "".join(path.read_text() for path in STATIC.glob("*.js"))
    called = re.findall(r"""(?:\bicon\(|\$\{Icon\} name=|\bicon=)"(\w+)\"""", scripts)
    named = set(called) | {panel.icon for panel in PANELS if panel.icon}
    assert len(named) > 15
    assert named <= outlines
