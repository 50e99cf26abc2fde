"""`vrs middleware train`: a network in a file, the same for the same seed; bad input is one line."""

from __future__ import annotations

import json

import pytest

from interfaces.cli.main import exit_status
from interfaces.middleware import load_network


def test_training_writes_a_network(tmp_path, capsys):
    out = tmp_path / "net.json"
    arguments = ["middleware", "train", "--out", str(out), "--seed", "4", "--epochs", "30", "--epsilon", "0.5"]
    assert exit_status([*arguments, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    network = load_network(out)
    assert (network.epsilon, network.seed, network.epochs) == (0.5, 4, 30)
    assert found["epochs"] == 30
    assert set(found["errors"]) == {"uniform", "log-uniform"}
    assert 0 < found["errors"]["uniform"]["p99"] < 1
    first = out.read_bytes()
    assert exit_status(arguments) == 0
    captured = capsys.readouterr()
    assert "relative error of K p99" in captured.out
    assert "training" in captured.err
    assert out.read_bytes() == first


@pytest.mark.parametrize(("arguments", "said"), [
    ([], "command"),
    (["fly"], "fly"),
    (["train"], "--out"),
    (["train", "--out", "{tmp}"], "must be a file"),
    (["train", "--out", "{tmp}/missing/net.json"], "must be a file"),
    (["train", "--out", "{tmp}/net.json", "--epsilon", "7"], "--epsilon"),
    (["train", "--out", "{tmp}/net.json", "--seed", "-1"], "--seed"),
    (["train", "--out", "{tmp}/net.json", "--neurons", "0"], "--neurons"),
])  # fmt: skip
def test_bad_input_is_one_line_and_exit_2(tmp_path, capsys, arguments, said):
    assert exit_status(["middleware", *(word.format(tmp=tmp_path) for word in arguments)]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("vrs: ")
    assert said in captured.err
