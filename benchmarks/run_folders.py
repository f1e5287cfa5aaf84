"""What becomes of a run folder: many recipes in one folder, and runs that are killed.

    python benchmarks/run_folders.py recipes [N]    # N folders, each with several recipes in turn
    python benchmarks/run_folders.py kills [N]      # N runs ended by SIGKILL, SIGTERM and SIGHUP

Seeds are fixed; SEED=1 in the environment draws others.
"""

import ctypes
import fcntl
import hashlib
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from importlib import import_module
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import psutil

from besman.synthetic.datasets import write_synthetic

SEED = int(os.environ.get("SEED", "0"))
FAST = (
    "recognize.examples_per_class=2", "map.evaluations=1", "map.correct=false",
    "map.greatest_error_m=1.0", "refine.episodes=2", "refine.robustness=null",
    "label.method=named", "imitate.lead_in_s=0.1", "imitate.lead_out_s=0.1",
)  # fmt: skip
CHOICES = {
    "select.label": ("throw", "strike_out", "swing_out"),
    "robot": ("ur5", "ur10"),
    "training": (False, True),
    "refine.seed": (0, 1),
    "refine.method": ("cma_es", "cem"),
    "imitate.n_weights": (10, 12),
    # The last fails in `map`.
    "map.greatest_error_m": (1.0, 1.0, 1.0, 1e-9),
}
GRACE_S = 3.0


def find(*names):
    """Return the first of some names that this build of besman has, as MODULE:NAME."""
    for name in names:
        module, _, attribute = name.partition(":")
        try:
            return getattr(import_module(module), attribute)
        except (ImportError, AttributeError):
            continue
    raise ImportError(f"this build has none of {names}")


load_pipeline = find("besman.pipeline.config:load_pipeline", "besman.pipeline:load_pipeline")
run_pipeline = find("besman.pipeline.pipeline:run_pipeline", "besman.pipeline:run_pipeline")
find_resource = find("besman.config.resources:find_resource", "besman.resources:find_resource")
load_records = find("besman.report.run_records:load_records")
read_run = find("besman.pipeline.finished_run:read_run", "besman.templates.files:read_run")
trained_model = find("besman.pipeline.finished_run:trained_model", "besman.pipeline:trained_model")
digest = find("besman.records.files:digest", "besman.record_files:digest")
BesmanError = find("besman.exceptions:BesmanError")
MAP = ("besman.stages.map.map_demonstrations", "besman.mapping.embodiment")


def share_mapping():
    """Map what was mapped before from memory: most of a small run is spent there."""
    module = import_module(find(*(f"{name}:__name__" for name in MAP)))
    compute, known = module.map_embodiment, {}

    def look_up(demonstrations, robot, settings, work):
        key = (digest(tuple(demonstrations)), digest(robot.content), repr(settings))
        if key not in known:
            known[key] = compute(demonstrations, robot, settings, work)
        return known[key]

    module.map_embodiment = look_up


def sha(path):
    return hashlib.sha256(path.read_bytes()).hexdigest()


def exports_of(folder):
    return {path.name: sha(path) for path in (folder / "exports").glob("*")}


def read(function, *arguments):
    """Return the digest of what a reader takes from a run; None if it refuses."""
    try:
        return digest(function(*arguments))
    except BesmanError:
        return None


def readers(folder):
    """Return what every reader of a run takes from it."""
    shown = load_records(folder)
    return {
        # Also the page and the replay, which show whatever they find.
        "report, view": {name: digest(record) for name, record in shown.items()},
        "templates, transfer": read(lambda: read_run(folder).motions),
        "retarget": read(trained_model, folder),
    }


class Recipes:
    """Recipes on a small capture, and what each gives in a folder of its own."""

    def __init__(self, place):
        self.place, self.known = place, {}
        for name, seed in (("capture", 3), ("training", 4)):
            if not (place / name).exists():
                write_synthetic("stick_throw", place / name, 1, 2, seed=seed)

    def draw(self, rng):
        return tuple((key, rng.choice(values)) for key, values in CHOICES.items())

    def run(self, recipe, folder):
        """Run a recipe; return whether it ended well."""
        settings = [f"recordings={self.place / 'capture'}", "tool=gripper", *FAST]
        for key, value in recipe:
            if key != "training":
                settings.append(f"{key}={value}")
            elif value:
                settings.append(f"training={self.place / 'training'}")
        try:
            run_pipeline(
                load_pipeline(find_resource("pipelines", "ur5_reach"), tuple(settings)), folder
            )
        except BesmanError:
            return False
        return True

    def alone(self, recipe):
        """Return exports and readers' takings of a recipe in a folder of its own."""
        if recipe not in self.known:
            folder = self.place / "alone"
            shutil.rmtree(folder, ignore_errors=True)
            self.known[recipe] = (self.run(recipe, folder), exports_of(folder), readers(folder))
        return self.known[recipe]


def set_clock_back(folder, days):
    """Let all files be as old as they would be after the clock was set forth and back."""
    for path in folder.rglob("*"):
        stat = path.stat()
        os.utime(path, (stat.st_atime + 86400 * days, stat.st_mtime + 86400 * days))


def count_recipes(n, most=5):
    """Run several recipes in each of n folders; count what belongs to another one."""
    share_mapping()
    found, rng = Counter(), random.Random(SEED)
    with tempfile.TemporaryDirectory() as place:
        recipes = Recipes(Path(place))
        for _ in range(n):
            folder = Path(place) / "run"
            shutil.rmtree(folder, ignore_errors=True)
            for _ in range(rng.randint(2, most)):
                recipe = recipes.draw(rng)
                recipes.run(recipe, folder)
                found["runs"] += 1
                _, exports, taken = recipes.alone(recipe)
                there, now = exports_of(folder), readers(folder)
                found["exports that do not belong"] += len(there.keys() - exports.keys())
                found["exports of other content"] += sum(
                    there[name] != exports[name] for name in there.keys() & exports.keys()
                )
                found["exports missing"] += len(exports.keys() - there.keys())
                for reader, expected in taken.items():
                    found[f"{reader}: another recipe's"] += now[reader] != expected
                set_clock_back(folder, rng.choice((-1, 0, 1)))
    return dict(found)


class Child:
    """A run in a process of its own, forked so that nothing has to be imported again."""

    def __init__(self, arguments):
        main = find("besman.cli.main:main", "besman.cli:main")
        self.pid = os.fork()
        if not self.pid:
            os.setsid()
            quiet = os.open(os.devnull, os.O_WRONLY)
            for stream in (1, 2):
                os.dup2(quiet, stream)
            sys.argv = ["besman", *map(str, arguments)]
            try:
                main()
            except SystemExit as end:
                os._exit(int(end.code or 0))
            os._exit(0)

    def wait(self, seconds=None):
        """Return the exit code, minus the signal if that ended it; None if it goes on."""
        until = None if seconds is None else time.monotonic() + seconds
        while True:
            pid, status = os.waitpid(self.pid, 0 if until is None else os.WNOHANG)
            if pid:
                return os.waitstatus_to_exitcode(status)
            if time.monotonic() > until:
                return None
            time.sleep(0.01)


def count_orphans():
    """Return how many processes are left a while after their parent; they are ended then."""
    until = time.monotonic() + GRACE_S
    while True:
        left = [one for one in psutil.Process().children() if one.status() != "zombie"]
        if not left or time.monotonic() > until:
            break
        time.sleep(0.05)
    for one in left:
        one.kill()
    for one in psutil.Process().children():
        one.wait()
    return len(left)


def is_free(folder):
    with (folder / ".lock").open() as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
    return True


def content_of(folder):
    """Return digests of all that must be the same however often a run was ended."""
    kept = [*folder.glob("[0-9][0-9]_*/record.npz"), *folder.glob("exports/*")]
    return {str(path.relative_to(folder)): sha(path) for path in [*kept, folder / "results.json"]}


def count_kills(n, arguments=()):
    """End runs at random moments, run them again to the end, and compare with one left alone."""
    ctypes.CDLL(None).prctl(36, 1)  # Orphans become this process' children.
    found, rng = Counter(), random.Random(SEED)
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        write_synthetic("stick_throw", place / "capture", 1, 2, seed=3)
        command = [
            "run", "ur5_stick_throw", "--jobs", 2, "--set", f"recordings={place / 'capture'}",
            "--set", "recognize.examples_per_class=2", "--set", "map.evaluations=20",
            "--set", "refine.episodes=4000", "--set", "refine.robustness={models: 2}", *arguments,
        ]  # fmt: skip
        start = time.monotonic()
        Child([*command, "--out", place / "alone"]).wait()
        seconds, expected = time.monotonic() - start, content_of(place / "alone")
        found["seconds of a whole run"] = round(seconds, 1)
        chain = 0
        while found["ended"] < n:
            folder, chain = place / f"run{chain}", chain + 1
            while found["ended"] < n:
                child = Child([*command, "--out", folder])
                number = rng.choice((signal.SIGKILL, signal.SIGTERM, signal.SIGHUP))
                if child.wait(rng.uniform(0.3, seconds)) is not None:
                    break
                os.kill(child.pid, number)
                asked = time.monotonic()
                code = child.wait()
                note_end(found, folder, number, code, time.monotonic() - asked)
                print(f"\r{found['ended']} of {n} ended ", end="", file=sys.stderr, flush=True)
            found["left running"] += Child([*command, "--out", folder]).wait() != 0
            found["other bytes in the end"] += content_of(folder) != expected
            found["run to the end"] += 1
            shutil.rmtree(folder)
    return dict(found)


def note_end(found, folder, number, code, seconds):
    """Count how a run ended that was asked to."""
    name = number.name
    found["ended"] += 1
    found[f"ended by {name}"] += 1
    found["orphans"] += count_orphans()
    found["slowest answer to SIGTERM or SIGHUP, s"] = max(
        found["slowest answer to SIGTERM or SIGHUP, s"],
        0.0 if number == signal.SIGKILL else round(seconds, 2),
    )
    if not (folder / "run.json").exists():
        found["ended before run.json"] += 1
        return
    found["locks held"] += not is_free(folder)
    status = json.loads((folder / "run.json").read_text())["status"]
    found[f"status {status} after {name}"] += 1
    # A run that was done before the signal came ends as it would have ended.
    if number != signal.SIGKILL and code != 128 + number:
        found[f"exit code {code} of a run that was {status}"] += 1
        found["other exit codes"] += not (status == "done" and code == 0)


def main():
    """Print the counts of an experiment, or of both."""
    which, n = sys.argv[1:2], [int(word) for word in sys.argv[2:3]]
    experiments = {"recipes": (count_recipes, 50), "kills": (count_kills, 100)}
    for name in which or experiments:
        count, usual = experiments[name]
        found = count(*(n or [usual]))
        print(f"{name}, seed {SEED}:")
        for key, value in sorted(found.items()):
            print(f"  {key}: {value}")


if __name__ == "__main__":
    main()
