"""A Dask scheduler and two workers on 127.0.0.1, at ports that the system chooses."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from functools import partial

import psutil
import pytest
from places import TESTS, TOP

from besman.exceptions import RunError
from besman.records import Failure
from besman.records.files import digest
from besman.robot.model import load_robot
from besman.simulation.tasks.kinds import load_task
from besman.stages.map.stage import MapConfig
from besman.stages.refine.stage import CmaEsConfig
from besman.work.outcome import Notes
from besman.work.work import Work
from besman.work.workers import Workers

sys.path.insert(0, str(TESTS))

import worker_items
from dart_throws import throw

pytest.importorskip("distributed")

LOCAL = ("--host", "127.0.0.1", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")
ROBOT = load_robot("ur5", "stick_holder")
QUICK = MapConfig(free_axis_spin=True, evaluations=10, yaw=False)


def start(part, folder, *options):
    command = [sys.executable, "-m", f"distributed.cli.dask_{part}", *LOCAL, *options]
    path = os.pathsep.join([str(TESTS), str(TOP)])
    with (folder / f"{part}.log").open("a") as log:
        return subprocess.Popen(
            command, stdout=log, stderr=log, env={**os.environ, "PYTHONPATH": path}
        )


def wait_for(condition):
    until = time.monotonic() + 240
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.05)


class Cluster:
    """A scheduler and its workers: what a test has killed, the next one that needs it starts."""

    def __init__(self, folder):
        self._folder, self.scheduler, self.address, self.workers = folder, None, "", []
        self._n_started = 0

    def with_workers(self, n, allowed_failures=3):
        """Have n workers, no more; an item is given up when it has killed some more than so many.

        Three is what Dask's own settings say.
        """
        if self.scheduler is None or self.scheduler.poll() is not None:
            self._start_scheduler()
        self.workers = [one for one in self.workers if one.poll() is None]
        while len(self.workers) > n:
            self._stop(self.workers.pop())
        options = ("--no-nanny", "--nthreads", "1", "--memory-limit", "0", "--local-directory")
        while len(self.workers) < n:
            self._n_started += 1
            place = self._folder / f"w{self._n_started}"
            self.workers.append(start("worker", self._folder, self.address, *options, place))
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            wait_for(lambda: len(client.nthreads()) == n)
            client.run_on_scheduler(_allow, allowed_failures)
        return self

    def _start_scheduler(self):
        file = self._folder / "s.json"
        file.unlink(missing_ok=True)
        self.scheduler = start("scheduler", self._folder, "--port", "0", "--scheduler-file", file)
        wait_for(lambda: file.exists() and file.read_text().endswith("}"))
        self.address = json.loads(file.read_text())["address"]

    def kill_workers(self):
        for process in self.workers:
            process.kill()

    def _stop(self, process):
        process.kill()
        process.wait()

    def stop(self):
        for process in (*self.workers, self.scheduler):
            if process is not None:
                self._stop(process)


def _allow(n, dask_scheduler):
    dask_scheduler.allowed_failures = n


@pytest.fixture(scope="module")
def processes(tmp_path_factory):
    one = Cluster(tmp_path_factory.mktemp("cluster"))
    yield one
    one.stop()


@pytest.fixture
def cluster(processes, monkeypatch):
    """One for all tests, which ask it for as many workers as they need: a start costs seconds."""
    # A scheduler on a busy machine may be slow to answer.
    monkeypatch.setattr("besman.work.cluster._CONNECT_S", 60.0)
    return processes


def killer(victim, at):
    """Progress that kills a process, the first time that it gets so far."""
    shares = []

    def progress(done):
        if done >= at and not any(share >= at for share in shares):
            os.kill(victim().pid, signal.SIGKILL)
        shares.append(done)

    return progress, shares


def demonstrations(n):
    return tuple(throw(index) for index in range(n))


# Enough that every worker has had some when one is killed, and has some after it.
N = 12


@pytest.fixture(scope="module")
def mapped():
    """What one thread makes of the demonstrations."""
    return digest(QUICK.run(demonstrations(N), ROBOT))


@pytest.mark.slow
def test_refinement_is_the_same_in_threads_processes_and_a_cluster(cluster, make_plan, monkeypatch):
    robot, task = load_robot("ur5", "stick_holder"), load_task("stick_throw")
    plans = tuple(make_plan(0.54 + 0.01 * n, name=f"a:{n}") for n in range(3))
    config = CmaEsConfig(episodes=18)
    monkeypatch.setattr("besman.stages.refine.stage._EPISODES_FOR_PROCESSES", 0)
    alone = digest(config.run(plans, robot, task))
    assert digest(config.run(plans, robot, task, Work(2))) == alone
    with Workers(2, cluster.with_workers(2).address) as workers, Workers(1) as local:
        for used in (local, workers):
            notes = Notes()
            assert digest(config.run(plans, robot, task, Work(2, workers=used))) == alone
            some = (plans[0], make_plan(0.5, name="a:9", target=[float("nan")] * 3))
            motions = config.run(some, robot, task, Work(2, notes=notes, workers=used))
            assert len(motions) == 1
            reason = "task stick_throw needs a target on the floor"
            assert [one.name for one in notes.failures] == ["a:9"]
            assert notes.failures[0].reason.startswith(reason)


@pytest.mark.slow
def test_a_worker_with_other_code_is_refused(cluster, monkeypatch):
    monkeypatch.setattr("besman.work.spread.environment", lambda: {"code": "0123"})
    with (
        Workers(1, cluster.with_workers(2).address) as workers,
        pytest.raises(RunError, match=r"worker .* has code \w+; expected what .*: code 0123"),
    ):
        Work(1, notes=Notes(), workers=workers).map(worker_items.double, [1, 2], name=str)


@pytest.mark.slow
def test_nothing_listens_beyond_this_machine(cluster):
    cluster.with_workers(2)
    with Workers(1, cluster.address) as workers:
        Work(1, workers=workers).map(worker_items.double, [1, 2], name=str)
        for pid in (os.getpid(), *(one.pid for one in (cluster.scheduler, *cluster.workers))):
            for connection in psutil.Process(pid).net_connections():
                if connection.status == psutil.CONN_LISTEN:
                    assert connection.laddr.ip == "127.0.0.1"


@pytest.mark.slow
def test_a_killed_worker_of_a_cluster_changes_nothing(cluster, mapped):
    notes = Notes()
    processes = tuple(cluster.with_workers(2).workers)
    with Workers(1, cluster.address) as workers:
        progress, shares = killer(lambda: processes[0], 0.75)
        mapping = QUICK.run(demonstrations(N), ROBOT, Work(1, progress, notes, workers))
        assert processes[0].wait(timeout=60) == -signal.SIGKILL
        pids = {f"{socket.gethostname()}:{process.pid}" for process in processes}
        assert set(notes.workers) <= pids
        assert f"{socket.gethostname()}:{processes[1].pid}" in notes.workers
    assert not mapping.failed
    assert digest(mapping) == mapped
    assert shares == sorted(shares)


@pytest.mark.slow
def test_a_killed_process_changes_nothing(mapped, monkeypatch):
    monkeypatch.setattr("besman.stages.map.map_demonstrations._PROCESSES_FROM", 1)

    def victim():
        # Forked from a process that this one has started.
        others = [one.children() for one in psutil.Process().children()]
        return next(child for children in others for child in children)

    notes = Notes()
    with Workers(1) as workers:
        progress, shares = killer(victim, 0.75)
        mapping = QUICK.run(demonstrations(N), ROBOT, Work(2, progress, notes, workers))
    assert len(notes.workers) > 1
    assert not mapping.failed
    assert digest(mapping) == mapped
    assert shares == sorted(shares)


@pytest.mark.slow
def test_an_item_that_fails_or_kills_is_a_row(cluster):
    # A scheduler that gives up at once, so that three workers are enough.
    cluster.with_workers(3, allowed_failures=0)
    with Workers(1, cluster.address) as workers:
        notes = Notes()
        work = Work(1, notes=notes, workers=workers)
        assert work.map(worker_items.refuse_odd, range(4), name=str) == [0, 2]
        assert notes.failures[0] == Failure("1", "ValueError: 1 is odd")
        die = partial(worker_items.die_of, deadly=(5,))
        rest = [n for n in range(12) if n != 5]
        assert work.map(die, range(12), name=str) == rest
        assert notes.failures[-1].name == "5"
        reason = "the worker process died of it, alone with it once"
        assert notes.failures[-1].reason.startswith(reason)


@pytest.mark.slow
def test_a_cluster_that_is_lost_is_an_error(cluster, monkeypatch):
    monkeypatch.setattr("besman.work.cluster._NO_WORKERS_S", 1.0)
    with Workers(1, cluster.with_workers(1).address) as workers:
        work = Work(1, lambda done: cluster.kill_workers(), Notes(), workers)
        with pytest.raises(RunError, match=r"no workers for 1 s; the same command goes on"):
            work.map(worker_items.linger, range(100), name=str)


@pytest.mark.slow
def test_a_scheduler_without_workers(cluster, monkeypatch):
    monkeypatch.setattr("besman.work.cluster._FIRST_WORKER_S", 0.5)
    message = r"the scheduler has no workers; start some with: dask worker tcp://127\.0\.0\.1:"
    with pytest.raises(RunError, match=message):
        Workers(1, cluster.with_workers(0).address)


@pytest.mark.slow
def test_a_scheduler_that_dies_is_an_error(cluster, monkeypatch):
    monkeypatch.setattr("besman.work.cluster._CONNECT_S", 15.0)
    with Workers(1, cluster.with_workers(1).address) as workers:
        # It looks for its scheduler for longer than its end may take.
        monkeypatch.setattr("besman.work.cluster._CONNECT_S", 1.0)
        work = Work(1, lambda done: cluster.scheduler.kill(), Notes(), workers)
        with pytest.raises(RunError, match=r"the scheduler is lost|no Dask scheduler answers"):
            work.map(worker_items.linger, range(100), name=str)


@pytest.fixture
def closed_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.mark.slow
def test_an_address_that_does_not_answer(closed_port, monkeypatch, tmp_path, capsys):
    from besman.cli import main as cli

    address = f"tcp://127.0.0.1:{closed_port}"
    arguments = ["run", "ur5_stick_throw", "--out", tmp_path / "r", "--cluster", address]
    monkeypatch.setattr("sys.argv", ["besman", *map(str, arguments)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    assert caught.value.code == 2
    said = capsys.readouterr().err.strip()
    assert said.startswith(f"besman: error: --cluster {address}: no Dask scheduler answers within")
    assert len(said.splitlines()) == 1
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
def test_an_address_that_says_nothing():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()
        address = f"tcp://127.0.0.1:{one.getsockname()[1]}"
        with pytest.raises(RunError, match="no Dask scheduler answers within 5 s"):
            Workers(1, address)


@pytest.mark.parametrize("address", ["127.0.0.1:8786", "tcp://host", "http://host:1"])
def test_what_is_no_address(address):
    with pytest.raises(RunError, match=r"--cluster: got '.*', expected tcp://HOST:PORT"):
        Workers(1, address)


def test_without_dask(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(RunError, match=r"Dask is not installed; pip install 'besman\[cluster\]'"):
        Workers(1, "tcp://127.0.0.1:1")
