"""Sweeps on other machines' workers: the same bytes, versions compared first, nothing lost with who ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from interfaces.cli.main import exit_status
from interfaces.lab import executors, finished
from interfaces.lab.executors import WorkersLostError, WorkerVersionError, executor
from interfaces.lab.runner import pooled
from tests.interfaces.lab.cluster import HOUSE, Cluster, cluster
from vrs.errors import FormatError, InvalidValueError, VrsError

pytest.importorskip("distributed")
SWEEP = ("lab", "--robot", "bare", "--length", "2", "--delay", "thu", "--delay", "none", "--operator", "slalom")
# Dask's own sockets and loops end when they like.
pytestmark = pytest.mark.filterwarnings(
    "ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"
)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with cluster(tmp_path_factory.mktemp("cluster")) as made:
        yield made


def files(out: Path) -> dict[str, bytes]:
    return {
        path.name: path.read_bytes() for path in out.iterdir() if path.is_file() and path.name != "machines.csv"
    }


def lives_in(_: int) -> int:
    return os.getpid()


def refuse(name: str) -> None:
    raise InvalidValueError(name, 3, "something else")


def refuse_to_be_there(_: int) -> None:
    os._exit(1)


class TestDask:
    def test_the_same_bytes_as_one_process(
        self, two: Cluster, tmp_path: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        one, other = tmp_path / "one", tmp_path / "other"
        assert exit_status([*SWEEP, "--runs", "1", "--workers", "1", "--out", str(one)]) == 0
        assert exit_status([*SWEEP, "--runs", "1", "--on", two.address, "--out", str(other)]) == 0
        assert files(one) == files(other)
        assert not (one / "finished").exists()
        assert not (other / "finished").exists()
        said = capfd.readouterr().err
        assert f"2 workers at {two.address}, dashboard http://127.0.0.1:" in said
        rows = (other / "machines.csv").read_text().splitlines()
        assert rows[0] == "of,place,platform,blas"
        assert len(rows) == 5

    def test_what_a_worker_refuses_is_refused(self, two: Cluster) -> None:
        with executor(two.address) as who:
            assert {*pooled([(lives_in, (k,)) for k in range(20)], workers=who)} == {w.pid for w in two.workers}
            with pytest.raises(InvalidValueError, match="part must be something else; given: 3"):
                pooled([(refuse, ("part",))], workers=who)

    def test_versions_are_compared_first(self, two: Cluster, monkeypatch: pytest.MonkeyPatch) -> None:
        found = finished.versions() | {"numpy": "1.0", finished.SOURCES: "of another time"}
        monkeypatch.setattr(finished, "versions", lambda: found)
        with pytest.raises(WorkerVersionError) as caught, executor(two.address):
            pass
        assert "numpy" in str(caught.value)
        assert "(here 1.0)" in str(caught.value)
        assert "(here of another time)" in str(caught.value)
        assert "\n" not in str(caught.value)

    def test_a_worker_that_comes_later_compares_them_too(self, two: Cluster) -> None:
        with executor(two.address) as who, pytest.raises(WorkerVersionError, match=r"worker on .* \(here 1.0\)"):
            who.submit(executors.make, finished.versions() | {"numpy": "1.0"}, lives_in, (1,)).result(60)

    def test_nobody_there_is_said_in_a_line(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(executors, "TIMEOUT", 1.0)
        begun = time.monotonic()
        assert exit_status([*SWEEP, "--on", "tcp://127.0.0.1:1", "--out", str(tmp_path)]) == 2
        assert time.monotonic() - begun < 20
        (said,) = capfd.readouterr().err.splitlines()
        assert said.startswith(
            "vrs: on must be the address of a Dask scheduler that answers within 1 s; given: 'tcp:"
        )

    def test_no_dask_is_said_in_a_line(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setitem(sys.modules, "distributed", None)
        with pytest.raises(InvalidValueError, match=r"pip install 'vrs-teleop\[cluster\]'"), executor("tcp://h:1"):
            pass

    @pytest.mark.slow
    def test_no_worker_and_a_worker_without_the_package_say_so(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = os.pathsep.join([str(HOUSE / "tests" / "without"), str(HOUSE)])
        with cluster(tmp_path, 0, PYTHONPATH=path, VRS_WITHOUT=",".join(finished.PACKAGES)) as made:
            monkeypatch.setattr(executors, "FIRST_WORKER", 1.0)
            with pytest.raises(InvalidValueError, match="a scheduler that has a worker"), executor(made.address):
                pass
            made.add_worker()
            made.wait()
            with pytest.raises(WorkerVersionError, match="hasn't got vrs-teleop"), executor(made.address):
                pass

    @pytest.mark.slow
    def test_a_run_that_ends_its_worker_is_given_up(self, tmp_path: Path) -> None:
        with cluster(tmp_path, 4, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1") as made:
            lost = pytest.raises(WorkersLostError, match=r"lost worker after worker by one run.*--resume")
            with lost, executor(made.address) as who:
                pooled([(refuse_to_be_there, (0,))], workers=who)

    @pytest.mark.slow
    def test_worker_killed_then_scheduler_and_nothing_is_lost(self, tmp_path: Path) -> None:
        one, other, place = tmp_path / "one", tmp_path / "other", tmp_path / "first"
        asked = [*SWEEP, "--runs", "12", "--length", "8"]
        place.mkdir()
        with cluster(place) as first:
            process = vrs(*asked, "--on", first.address, "--out", str(other))
            wait(process, other, 4)
            first.workers[0].send_signal(signal.SIGKILL)
            wait(process, other, rows(other) + 4)
            first.scheduler.send_signal(signal.SIGKILL)
            _, said = process.communicate(timeout=60)
        assert process.returncode == 2
        last = said.splitlines()[-1]
        assert last.startswith(f"vrs: {first.address} is gone")
        assert last.endswith("the same command with --resume goes on with what is finished")
        assert "Traceback" not in said
        before = {path: path.stat().st_mtime_ns for path in (other / "finished").glob("*.row")}
        assert 8 <= len(before) < 48
        second = tmp_path / "second"
        second.mkdir()
        with cluster(second) as again:
            process = vrs(*asked, "--on", again.address, "--out", str(other), "--resume")
            _, said = process.communicate(timeout=300)
        assert process.returncode == 0, said
        # What was finished isn't made again.
        assert {path: path.stat().st_mtime_ns for path in before} == before
        assert rows(other) == 48
        assert exit_status([*asked, "--workers", "1", "--out", str(one)]) == 0
        assert files(one) == files(other)


def vrs(*words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "interfaces.cli", *words], env=os.environ | {"PYTHONPATH": str(HOUSE)},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def rows(out: Path) -> int:
    return len(list((out / "finished").glob("*.row")))


def wait(process: subprocess.Popen[str], out: Path, many: int) -> None:
    deadline = time.monotonic() + 120
    while rows(out) < many:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)


class TestOwn:
    def test_an_executor_or_what_makes_one(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        (tmp_path / "my_pool.py").write_text(
            "from concurrent.futures import ThreadPoolExecutor\n"
            "def made(): return ThreadPoolExecutor(2)\n"
            "ready, odd, other = made(), 3, list\n"
        )
        monkeypatch.chdir(tmp_path)
        monkeypatch.syspath_prepend(tmp_path)
        for name in ("made", "ready"):
            with executor(f"my_pool:{name}") as who:
                assert isinstance(who, ThreadPoolExecutor)
                assert pooled([(lives_in, (k,)) for k in range(3)], workers=who) == [os.getpid()] * 3
            with pytest.raises(RuntimeError, match="shutdown"):
                who.submit(print)
        for name, why in (("odd", "a function or class there"), ("other", "an executor of concurrent.futures")):
            with pytest.raises(InvalidValueError, match=why), executor(f"my_pool:{name}"):
                pass
        with pytest.raises(FormatError, match="can't be imported as an executor"), executor("no_pool:made"):
            pass

    @pytest.mark.parametrize("given", ["head:8786", "http://head:8786", "4"])
    def test_neither_an_address_nor_a_name(self, given: str) -> None:
        with pytest.raises(VrsError, match="tcp://HOST:8786, or MODULE:NAME"), executor(given):
            pass

    def test_workers_and_on_arent_both_asked(self, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        assert exit_status([*SWEEP, "--on", "a:b", "--workers", "3", "--out", str(tmp_path)]) == 2
        assert capfd.readouterr().err == (
            "vrs: workers must be left out: --on says who does the work; given: '3'\n"
        )

    def test_a_network_is_trained_elsewhere_to_the_same_bytes(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "my_other_pool.py").write_text("from concurrent.futures import ThreadPoolExecutor as made\n")
        monkeypatch.chdir(tmp_path)
        asked = ["middleware", "train", "--epochs", "3", "--neurons", "3"]
        assert exit_status([*asked, "--out", "here.json"]) == 0
        assert exit_status([*asked, "--out", "there.json", "--on", "my_other_pool:made"]) == 0
        assert Path("here.json").read_bytes() == Path("there.json").read_bytes()
        capfd.readouterr()
