"""Every notebook runs from top to bottom, headless, and shows both twins; none is kept with what it put out."""

from __future__ import annotations

import json
import os
import re
from html import unescape
from pathlib import Path
from typing import Any

import pytest

HOME = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((HOME / "examples" / "notebooks").glob("*.ipynb"))


def executed(path: Path, at: Path) -> Any:
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    client = NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(at)}})
    return client.execute(env={**os.environ, "PYTHONPATH": str(HOME), "IPYTHONDIR": str(at), "HOME": str(at)})


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_runs_and_shows_the_twins(path: Path, tmp_path: Path) -> None:
    notebook = executed(path, tmp_path)
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in shown if output.output_type == "error" or output.get("name") == "stderr"]
    frames = [
        output.data["text/html"] for output in shown if "<iframe" in output.get("data", {}).get("text/html", "")
    ]
    assert len(frames) == 1
    page = unescape(re.search(r'srcdoc="([^"]*)"', frames[0])[1])  # type: ignore[index]
    assert page.startswith("<!DOCTYPE html>")
    assert not re.search(r'(src|href)="https?:', page)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_is_kept_bare_and_short(path: Path) -> None:
    cells = json.loads(path.read_text())["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert sum(len(cell["source"]) for cell in code) < 80
    assert cells[0]["source"][0].startswith("# ")


def test_there_are_two() -> None:
    assert len(NOTEBOOKS) >= 2
