"""Path files: what they say is what is driven, and what's wrong is one line with its place."""

from __future__ import annotations

import numpy as np
import pytest

from robots.onboard.curve import Curve, CurveKind, load_curve, read_curve
from vrs.errors import FormatError

GOOD = """# a path
path 1
curve quadratic
0 1          # begin

1.5 1.8
3e0 -2
"""


def test_a_file_is_its_points(tmp_path):
    path = tmp_path / "s.path"
    path.write_text(GOOD)
    curve = load_curve(path)
    assert curve.kind is CurveKind.QUADRATIC
    assert np.array_equal(curve.points, [(0, 1), (1.5, 1.8), (3, -2)])
    assert curve.length == Curve(curve.points, "quadratic").length
    assert read_curve("path 1\n0 0\n1 1").kind is CurveKind.CUBIC


@pytest.mark.parametrize(("text", "said"), [
    ("", "begins with the line 'path 1'"),
    ("0 0\n1 1", "line 1: a path begins with the line 'path 1'"),
    ("path 2\n0 0\n1 1", "line 1"),
    ("path 1\n0 0", "2 to 2000 points are allowed; given: 1"),
    ("path 1\n0 0\n1", "line 3: a point is two numbers"),
    ("path 1\n0 0\n1 x", "line 3: a point is two numbers, x and y [m]; given: '1 x'"),
    ("path 1\n0 0\nnan 1", "line 3: x and y must be within"),
    ("path 1\n0 0\n1 1e9", "line 3: x and y must be within ±10000 m"),
    ("path 1\n0 0\ncurve cubic\n1 1", "line 3: 'curve' stands before the points"),
    ("path 1\ncurve straight\n0 0\n1 1", "line 2: 'curve cubic' or 'curve quadratic' is allowed"),
    ("path 1\n0 0\n0 0", "its points must be rows that differ"),
    ("path 1\n" + "0 0\n1 1\n" * 1001, "given: 2002"),
])  # fmt: skip
def test_what_is_no_path(text, said):
    with pytest.raises(FormatError) as caught:
        read_curve(text, "my.path")
    assert said in str(caught.value)
    assert str(caught.value).startswith("my.path")
    assert "\n" not in str(caught.value)


def test_files_that_cant_be_read(tmp_path):
    for name, data, said in (("a", b"\xff\xfe\x00", "no UTF-8"), ("b", b"#" * 300_000, "longer than")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(FormatError, match=said):
            load_curve(tmp_path / name)
    with pytest.raises(FormatError, match="can't be read"):
        load_curve(tmp_path / "missing")
