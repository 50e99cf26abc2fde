"""Units, compose files and manifest: their hardening, and that their command lines run and end as they're told.

systemd itself isn't run here: what it makes of a unit is what `systemd-analyze` says of it.
"""

from __future__ import annotations

import configparser
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
import typer
import yaml

from interfaces.cli.main import app

DEPLOY = Path(__file__).resolve().parents[1] / "deploy"
UNITS = ("vrs-serve.service", "vrs-robot.service")
SERVICES = ("serve", "robot")
EXPOSURE = 20
"""Most that `systemd-analyze security` may say of a unit, of 100."""
ANALYZE = shutil.which("systemd-analyze")
needs_systemd = pytest.mark.skipif(ANALYZE is None, reason="systemd-analyze isn't here: units aren't checked by it")


def unit(name: str) -> dict[str, list[str]]:
    """The settings of a unit's service."""
    found: dict[str, list[str]] = {}
    section = (DEPLOY / name).read_text().partition("[Service]\n")[2].partition("\n[")[0]
    for line in section.splitlines():
        if line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found


def service(name: str) -> dict[str, Any]:
    """A service of the compose file."""
    found: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text())["services"][name]
    return found


def command(name: str) -> list[str]:
    """What a unit or a service runs."""
    return unit(name)["ExecStart"][0].split() if name in UNITS else [str(word) for word in service(name)["command"]]


def analyzed(*words: str) -> subprocess.CompletedProcess[str]:
    assert ANALYZE is not None
    return subprocess.run([ANALYZE, *words], capture_output=True, text=True, timeout=60, check=False)


@needs_systemd
@pytest.mark.parametrize("name", UNITS)
def test_t19_systemd_finds_units_sound_and_little_exposed(name: str, tmp_path: Path) -> None:
    installed = tmp_path / name
    program = Path(sys.executable).with_name("vrs")
    installed.write_text((DEPLOY / name).read_text().replace("/opt/vrs-teleop/.venv/bin/vrs", str(program)))
    verified = analyzed("verify", "--man=no", "--recursive-errors=no", str(installed))
    assert (verified.returncode, verified.stderr) == (0, "")
    secure = analyzed("security", "--offline=true", f"--threshold={EXPOSURE}", "--no-pager", str(installed))
    assert secure.returncode == 0, secure.stdout


@needs_systemd
def test_what_is_left_out_is_told(tmp_path: Path) -> None:
    open_ = tmp_path / UNITS[0]
    lines = (DEPLOY / UNITS[0]).read_text().splitlines(keepends=True)
    open_.write_text("".join(line for line in lines if not line.startswith(("Protect", "Restrict", "System"))))
    assert analyzed("security", "--offline=true", f"--threshold={EXPOSURE}", "--no-pager", str(open_)).returncode


@pytest.mark.parametrize("name", UNITS)
def test_t19_a_unit_gives_up_what_it_doesnt_need(name: str) -> None:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    assert parser.read(DEPLOY / name)
    told = unit(name)
    for key in ("DynamicUser", "NoNewPrivileges", "PrivateDevices", "PrivateUsers", "MemoryDenyWriteExecute"):
        assert told[key] == ["yes"]
    assert told["CapabilityBoundingSet"] == [""]
    assert told["ProtectSystem"] == ["strict"]
    # All that it writes lies in its own directory.
    assert told["WorkingDirectory"] == [f"%S/{told['StateDirectory'][0]}"]
    assert not [word for word in command(name)[1:] if word.startswith("/")]


@pytest.mark.parametrize("name", SERVICES)
def test_t19_a_container_gives_up_what_it_doesnt_need(name: str) -> None:
    found = service(name)
    assert found["read_only"] is True
    assert found["cap_drop"] == ["ALL"]
    assert found["security_opt"] == ["no-new-privileges:true"]
    assert found["user"] == "1000:1000"
    assert not {"privileged", "cap_add", "devices", "network_mode", "pid", "ipc"} & set(found)
    # Nothing of the host is mounted, and what is written lies in a volume or in memory.
    volumes = {volume.split(":")[0] for volume in found["volumes"]}
    assert volumes <= set(yaml.safe_load((DEPLOY / "compose.yaml").read_text())["volumes"])
    written = [word for word in found["command"] if str(word).startswith("/")]
    assert all(word.startswith("/data/") for word in written)
    # Off this machine by whoever says so.
    assert all(port.startswith("127.0.0.1:") for port in found["ports"])


def test_the_compose_file_is_one() -> None:
    engine = shutil.which("docker")
    if (
        engine is None
        or subprocess.run([engine, "compose", "version"], capture_output=True, check=False).returncode
    ):
        pytest.skip("docker compose isn't here: the file isn't checked by it")
    asked = [engine, "compose", "-f", str(DEPLOY / "compose.yaml"), "--profile", "robot", "config", "--quiet"]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")


READ_ONLY = """
set -e
mount --make-rprivate /
mount --bind "$1" "$1"
mount -o remount,ro,bind /
cd "$1"
shift
exec "$@"
"""
"""Runs a program for which all but a directory is read-only."""
HELD = """
import ctypes, os, sys
c = ctypes.CDLL(None)
assert c.prctl(38, 1, 0, 0, 0) == 0  # PR_SET_NO_NEW_PRIVS
c.prctl(65, 1, 0, 0, 0)  # PR_SET_MDWE, since Linux 6.3: no memory that's written becomes code
os.execv(sys.argv[1], sys.argv[1:])
"""
"""Runs a program as NoNewPrivileges and MemoryDenyWriteExecute do."""
MOUNTS = shutil.which("unshare") is not None and not subprocess.run(
    ["unshare", "--mount", "sh", "-ec", "mount --make-rprivate / && mount -o remount,ro,bind /"],
    capture_output=True, check=False,
).returncode  # fmt: skip


@contextmanager
def running(words: list[str], directory: Path, before: Sequence[str] = ()) -> Iterator[subprocess.Popen[bytes]]:
    """A command line of a file here, in a directory, held as it's there as far as this machine lets us."""
    own = [sys.executable, "-c", HELD, str(Path(sys.executable).with_name("vrs")), *words[1:]]
    read_only = ["unshare", "--mount", "sh", "-c", READ_ONLY, "sh", str(directory)] if MOUNTS else []
    homeless = {"HOME": "/nonexistent", "TMPDIR": str(directory)}
    kept = os.environ | homeless | {"MPLCONFIGDIR": str(directory), "XDG_CACHE_HOME": str(directory)}
    lines = [*read_only, *before, *own]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen(lines, cwd=directory, env=kept, **quiet, start_new_session=True) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


@pytest.mark.skipif(
    not MOUNTS, reason="mounting isn't allowed here: command lines were run with a root that's written to"
)
def test_all_but_its_directory_is_read_only_for_what_is_run(tmp_path: Path) -> None:
    there = tmp_path.parent / f"beside {tmp_path.name}"
    tried = ["unshare", "--mount", "sh", "-c", READ_ONLY, "sh", str(tmp_path), "touch", "here", str(there)]
    assert subprocess.run(tried, capture_output=True, check=False).returncode
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    assert not there.exists()


def free_port() -> str:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        return str(listening.getsockname()[1])


def run_till_it_is_well(name: str, directory: Path, before: Sequence[str] = ()) -> None:
    """Run what a file here runs, until the compose file's health check finds it well, and end it."""
    port, old = free_port(), "8601" if "robot" in name else "8600"

    def here(word: str) -> str:
        return word.replace(old, port).replace("/data", str(directory)).replace("0.0.0.0", "127.0.0.1")

    healthy = service("robot" if "robot" in name else "serve")["healthcheck"]["test"]
    assert healthy[:2] == ["CMD", "python"]
    looks = [sys.executable, *map(here, healthy[2:])]
    with running([*map(here, command(name)), "--tls"], directory, before) as process:
        end = time.monotonic() + 90.0
        while subprocess.run(looks, capture_output=True, check=False, cwd=directory).returncode:
            assert process.poll() is None
            assert time.monotonic() < end
            time.sleep(0.2)
        os.killpg(process.pid, signal.SIGTERM)
        assert process.wait(30.0) == 0


@pytest.mark.parametrize(
    "name",
    [
        "vrs-serve.service",
        "robot",
        pytest.param("vrs-robot.service", marks=pytest.mark.slow),
        pytest.param("serve", marks=pytest.mark.slow),
    ],
)
def test_t19_what_is_run_is_well_and_ends_when_told(name: str, tmp_path: Path) -> None:
    run_till_it_is_well(name, tmp_path)
    made = {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir() if path.is_file()}
    assert {"tokens", "tokens.tls.pem", "audit.jsonl"} <= set(made)
    assert {made[one] for one in ("tokens", "tokens.tls.pem", "audit.jsonl")} == {0o600}


def system_calls(group: str) -> set[str]:
    """What a group of system calls holds, as systemd has it."""
    words = [line.strip() for line in analyzed("syscall-filter", group).stdout.splitlines()[1:]]
    found: set[str] = set()
    for word in words:
        found |= (
            system_calls(word) if word.startswith("@") else {word} - {""} if not word.startswith("#") else set()
        )
    return found


@pytest.mark.slow
@needs_systemd
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace isn't here: system calls weren't compared")
@pytest.mark.parametrize("name", UNITS)
def test_no_system_call_is_made_that_a_unit_forbids(name: str, tmp_path: Path) -> None:
    groups = unit(name)["SystemCallFilter"]
    allowed = system_calls(groups[0])
    for group in groups[1:]:
        allowed -= system_calls(group.removeprefix("~"))
    traced = tmp_path / "traced"
    run_till_it_is_well(name, tmp_path, ["strace", "-f", "-qq", "-o", str(traced)])
    made = set(re.findall(r"(?m)^\d+ +([a-z_0-9]+)\(", traced.read_text(errors="replace")))
    assert len(made) > 50
    assert made - allowed == set()


CLUSTER: Final = ("scheduler", "worker", "sweep")


def documents() -> list[dict[str, Any]]:
    """What the Kubernetes manifest has."""
    return list(yaml.safe_load_all((DEPLOY / "kubernetes.yaml").read_text()))


def containers() -> dict[str, tuple[dict[str, Any], dict[str, Any]]]:
    """Its containers by their names, each with its pod's settings."""
    pods = [each["spec"]["template"]["spec"] for each in documents() if "template" in each["spec"]]
    return {one["name"]: (one, pod) for pod in pods for one in pod["containers"]}


def cluster_command(name: str, file: str) -> list[str]:
    """What a service of the compose file, or a container of the manifest, runs."""
    if file == "kubernetes.yaml":
        return [str(word) for word in containers()[name][0]["command"]]
    services = yaml.safe_load((DEPLOY / file).read_text())["services"]
    return [str(word) for word in services[name]["command"]]


@pytest.mark.parametrize("file", ["cluster.yaml", "kubernetes.yaml"])
@pytest.mark.parametrize("name", CLUSTER)
def test_a_clusters_command_is_one(name: str, file: str) -> None:
    program, what, *options = cluster_command(name, file)
    if program == "vrs":
        lab = typer.main.get_command(app).commands[what].make_context(what, options).params  # type: ignore[attr-defined]
        # A container that was ended goes on, where it's kept.
        assert lab["resume"]
        assert str(lab["out"]).startswith("/data/")
        assert lab["on"].endswith(":8786")
        return
    assert program == "dask"
    module = pytest.importorskip(f"distributed.cli.dask_{what}")
    found = module.main.make_context(what, options).params
    if what == "scheduler":
        assert found["port"] == "8786"
    else:
        # A process makes one run at a time.
        assert found["nthreads"] == 1
        assert found["scheduler"].endswith(":8786")


@pytest.mark.parametrize("name", CLUSTER)
def test_t19_a_clusters_container_gives_up_what_it_doesnt_need(name: str) -> None:
    compose = yaml.safe_load((DEPLOY / "cluster.yaml").read_text())
    found = compose["services"][name]
    assert found["read_only"] is True
    assert found["cap_drop"] == ["ALL"]
    assert found["security_opt"] == ["no-new-privileges:true"]
    assert found["user"] == "1000:1000"
    # Dask asks nobody for a token: nobody else is on its network.
    assert found["networks"] == ["sweep"]
    assert compose["networks"]["sweep"]["internal"] is True
    assert "ports" not in found
    one, pod = containers()[name]
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["automountServiceAccountToken"] is False
    assert one["securityContext"] == {
        "allowPrivilegeEscalation": False, "readOnlyRootFilesystem": True, "capabilities": {"drop": ["ALL"]},
    }  # fmt: skip
    assert {mount["name"] for mount in one["volumeMounts"]} == {volume["name"] for volume in pod["volumes"]}


def test_the_manifests_parts_find_each_other() -> None:
    by_kind: dict[str, list[dict[str, Any]]] = {}
    for each in documents():
        assert {"apiVersion", "kind", "metadata", "spec"} == set(each)
        by_kind.setdefault(each["kind"], []).append(each)
    for each in by_kind["Deployment"]:
        labels = each["spec"]["template"]["metadata"]["labels"]
        assert each["spec"]["selector"]["matchLabels"].items() <= labels.items()
    (service_,) = by_kind["Service"]
    named = {port["name"] for port in containers()["scheduler"][0]["ports"]}
    assert {port["targetPort"] for port in service_["spec"]["ports"]} == named
    assert f"tcp://{service_['metadata']['name']}:8786" in cluster_command("worker", "kubernetes.yaml")
    (job,), (claim,), (policy,) = by_kind["Job"], by_kind["PersistentVolumeClaim"], by_kind["NetworkPolicy"]
    volumes = job["spec"]["template"]["spec"]["volumes"]
    assert {"name": "data", "persistentVolumeClaim": {"claimName": claim["metadata"]["name"]}} in volumes
    pods = [each["spec"]["template"] for each in (*by_kind["Deployment"], job)]
    wanted = policy["spec"]["podSelector"]["matchLabels"].items()
    assert all(wanted <= pod["metadata"]["labels"].items() for pod in pods)
    assert len({one["image"] for one, _ in containers().values()}) == 1
