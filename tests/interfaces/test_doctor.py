"""The checks of `vrs doctor` can fail, and say what to mend."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from interfaces.cli import doctor
from interfaces.cli.main import exit_status


def test_this_machine_is_fine(capsys):
    assert exit_status(["doctor", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["ok"] is True
    assert {check["name"] for check in report["checks"]} >= {
        "python", "pybullet", "browser", "camera", "voice", "ports", "clock", "names",
    }  # fmt: skip


def test_text_says_fine(capsys):
    assert exit_status(["doctor"]) == 0
    assert "This machine is fine." in capsys.readouterr().out


def test_a_missing_browser_is_optional(monkeypatch, capsys):
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    assert exit_status(["doctor"]) == 0
    assert "to mend: install chromium" in capsys.readouterr().out


def test_a_missing_camera_and_voice_are_optional(monkeypatch, capsys):
    real = doctor.importlib.util.find_spec
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda name: None if name == "av" else real(name))
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    assert exit_status(["doctor"]) == 0
    said = capsys.readouterr().out
    assert "missing: av" in said
    assert "vrs-teleop[media]" in said
    assert "install the program espeak-ng" in said


def test_a_package_of_the_same_name_is_found(monkeypatch, capsys):
    real = doctor.importlib.util.find_spec

    def find_spec(name, package=None):
        return real("json") if name == "robots" else real(name, package)

    monkeypatch.setattr(doctor.importlib.util, "find_spec", find_spec)
    assert exit_status(["doctor"]) == 1
    assert "robots is" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("code", "stdout", "found"),
    [(0, "0\n", "without NumPy"), (-11, "", "crashed while loading"), (1, "", "No module named pybullet")],
)
def test_a_broken_pybullet_is_found(monkeypatch, code, stdout, found):
    stderr = "Traceback\nNo module named pybullet\n" if code == 1 else ""
    done = subprocess.CompletedProcess([sys.executable], code, stdout, stderr)
    monkeypatch.setattr(doctor.subprocess, "run", lambda *args, **kwargs: done)
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda name: name)
    assert doctor.check_pybullet() == (False, found)
