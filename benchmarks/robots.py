"""How many arms of public packages come in by their file alone, how long that takes, and what for.

    python benchmarks/robots.py [FOLDER...] [--only WORD]

Every URDF and MJCF of an arm below the folders (without one: of the installed
example-robot-data) is brought in. FOLDER is where a package was unpacked, for example by
``pip install --no-deps --target FOLDER robosuite``. A file counts as an arm if one chain of four
hinges or more is found in it; what is refused otherwise is listed. Capsules are held against the
meshes (coal) in 1000 random poses.
"""

from __future__ import annotations

import argparse
import re
import statistics
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path

import numpy as np
import pinocchio

from besman.config.yaml_file import load_config
from besman.exceptions import BesmanError
from besman.robot.config import RobotConfig
from besman.robot.files.mjcf_file import is_mjcf
from besman.robot.files.touching_links import pair_overlaps, random_poses
from besman.robot.link_shapes import collision_shapes
from besman.robot.model import Robot, load_robot, read_robot_urdf
from besman.robot.new_robot import add_robot

POSES = 1000
# Meshes that are this far apart should be called clear.
APART_M = 0.01
_NO_ARM = re.compile(r"more than one chain|no hinge moves|expected <robot>|not valid XML")


def find_files(folders: list[Path], only: str) -> list[Path]:
    """Return the URDFs and MJCFs below folders."""
    files = sorted(file for folder in folders for file in folder.rglob("*.urdf"))
    for folder in folders:
        for file in sorted(folder.rglob("robot.xml")):
            if is_mjcf(file.read_bytes()[:20_000]):
                files.append(file)
    return [file for file in files if only in str(file)]


def mesh_distances(path: Path, robot: Robot, poses: np.ndarray) -> np.ndarray | None:
    """Return the least distance of meshes that are held against each other, metres."""
    config = load_config(path, RobotConfig)
    tree, urdf = read_robot_urdf(config, path)
    shapes = collision_shapes(robot.model, tree, urdf)
    if len({link for link, *_ in shapes}) < 3:
        return None
    geometry = pinocchio.GeometryModel()
    for index, (link, joint, pose, shape, _) in enumerate(shapes):
        item = pinocchio.GeometryObject(f"{link} {index}", joint + 1, 0, pose, shape)
        geometry.addGeometryObject(item)
    ignored = {frozenset(pair) for pair in config.ignored_pairs}
    for first in range(len(shapes)):
        for second in range(first):
            links = frozenset((shapes[first][0], shapes[second][0]))
            if abs(shapes[first][1] - shapes[second][1]) > 1 and links not in ignored:
                geometry.addCollisionPair(pinocchio.CollisionPair(second, first))
    if not len(geometry.collisionPairs):
        return None
    data, placed = robot.model.createData(), geometry.createData()
    margins = [APART_M] * len(geometry.collisionPairs)
    touching = np.full(len(poses), np.inf)
    for limit in (APART_M, 0.0):
        for request, _ in zip(placed.collisionRequests, margins, strict=True):
            request.security_margin = limit
        for index, pose in enumerate(poses):
            if pinocchio.computeCollisions(robot.model, data, geometry, placed, pose, True):
                touching[index] = limit
    return touching


def measure(file: Path, folder: Path, number: int) -> dict[str, object]:
    """Bring one arm in; return what came of it."""
    start, work = time.perf_counter(), time.process_time()
    try:
        path = add_robot(file, name=f"arm{number}", folder=folder)
    except BesmanError as error:
        return {"error": str(error).removeprefix(f"{file}: ")}
    spent, worked = time.perf_counter() - start, time.process_time() - work
    robot = load_robot(path)
    if robot.n < 4:
        return {"error": "no hinge moves more than three links"}
    poses = random_poses(robot, POSES, seed=99)
    links = robot.chain.capsule_links
    real = ["pedestal" not in (links[a], links[b]) for a, b in robot.chain.capsule_pairs]
    touching = pair_overlaps(robot, poses)[:, real].any(axis=1)
    distance = mesh_distances(path, robot, poses)
    found: dict[str, object] = {"seconds": spent, "cpu_s": worked, "n": robot.n}
    found["clear"] = float((~touching).mean())
    if distance is not None:
        apart = distance > APART_M
        found["missed"] = int(np.sum(~touching & (distance <= 0)))
        found["lost"] = float(touching[apart].mean()) if apart.any() else float("nan")
    return found


def main() -> None:
    """Print a line for each arm and the figures of all."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    share = metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")
    folders = options.folders or [Path(str(share)) / "example-robot-data" / "robots"]
    rows, refused = [], []
    with tempfile.TemporaryDirectory() as place:
        for number, file in enumerate(find_files(folders, options.only)):
            found = measure(file, Path(place) / str(number), number)
            name = f"{file.parent.name}/{file.name}"
            if "error" in found:
                is_arm = not _NO_ARM.search(str(found["error"]))
                refused += [name] if is_arm else []
                sys.stdout.write(f"{name:45} {'REFUSED' if is_arm else 'no arm'}: "
                                 f"{str(found['error'])[:90]}\n")  # fmt: skip
                continue
            rows.append(found)
            words = [f"{key} {value:.3g}" for key, value in found.items()]  # type: ignore[str-format]
            sys.stdout.write(f"{name:45} {', '.join(words)}\n")
            sys.stdout.flush()
    if not rows:
        return
    spent = [float(row["seconds"]) for row in rows]  # type: ignore[arg-type]
    worked = [float(row["cpu_s"]) for row in rows]  # type: ignore[arg-type]
    lost = [float(row["lost"]) for row in rows if "lost" in row]  # type: ignore[arg-type]
    missed = [int(row["missed"]) for row in rows if "missed" in row]  # type: ignore[call-overload]
    sys.stdout.write(
        f"taken {len(rows)} of {len(rows) + len(refused)}; robots add, median and most: "
        f"{statistics.median(spent):.1f} s, {max(spent):.1f} s; of CPU "
        f"{statistics.median(worked):.1f} s, {max(worked):.1f} s\n"
        f"clear though meshes touch: {sum(missed)} of {POSES * len(missed)} poses\n"
        f"touching though meshes are clear by 1 cm, median and most: "
        f"{statistics.median(lost):.1%}, {max(lost):.1%}\n"
    )


if __name__ == "__main__":
    main()
