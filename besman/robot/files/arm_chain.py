"""Which joints of a URDF are the arm, and which link is its flange."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError, nearest
from besman.foreign.urdf_text import joint_ends, link_names

_HINGES = ("revolute", "continuous")
# What is called so takes things: it is moved by no arm's trajectory.
_GRIPPER = re.compile(r"gripper|finger|jaw|knuckle|thumb|claw|pinch|palm|leaf|_pad", re.IGNORECASE)
_SENSOR = re.compile(r"camera|optical|sensor|imu|lidar|laser|inertia|dummy", re.IGNORECASE)
# In front: what is called by convention the frame that tools are mounted on (ISO 9787).
_FLANGES = tuple(
    re.compile(words, re.IGNORECASE)
    for words in (
        r"(^|[_\-/])tool_?0$",
        r"attachment(_site|_link)?$",
        r"(^|[_\-/])flange(_link)?$",
        r"(^|[_\-/])ee_?link$|link_ee$|(^|_)end_?effector(_link)?$|(^|_)eef?$",
        r"link_?8$",
        r"(^|[_\-/])(tcp|tool_?(frame|link|tip)|tool)$",
    )
)
_LEAST_ARM = 4
_MOST_NAMED = 8


def find_chain(tree: ElementTree.Element, tip: str, urdf: Path) -> list[ElementTree.Element]:
    """Return the hinges from the root to a link; sliding joints between them are held.

    Raises
    ------
    RobotError
        If the link is not there, no hinge moves it, or a joint follows another one (``<mimic>``).
    """
    path = joints_above(tree, tip, urdf)
    chain = [joint for joint in path if joint.get("type") in _HINGES]
    for joint in chain:
        mimic = joint.find("mimic")
        if mimic is not None:
            raise RobotError(
                f"{urdf}: joint {joint.get('name')}: <mimic>: follows joint "
                f"{mimic.get('joint', '')!r:.60}; coupled joints within an arm cannot be used, "
                "expected a --tip before it"
            )
    if not chain:
        what = "no joint" if all(joint.get("type") == "fixed" for joint in path) else "no hinge"
        raise RobotError(f"{urdf}: tip: {what} moves the link {tip!r}")
    return chain


def held_joints(tree: ElementTree.Element, tip: str, urdf: Path) -> list[ElementTree.Element]:
    """Return the joints between root and tip that move and are no hinges."""
    path = joints_above(tree, tip, urdf)
    return [joint for joint in path if joint.get("type") not in (*_HINGES, "fixed")]


def joints_above(tree: ElementTree.Element, tip: str, urdf: Path) -> list[ElementTree.Element]:
    """Return all joints from the root to a link.

    Raises
    ------
    RobotError
        If the link is not there.
    """
    links = link_names(tree)
    if tip not in links:
        raise RobotError(f"{urdf}: tip: no link {tip!r}; {nearest(tip, links)}")
    above = {joint_ends(joint)[1]: joint for joint in tree.findall("joint")}
    path: list[ElementTree.Element] = []
    link = tip
    while link in above:
        path.insert(0, above[link])
        link = joint_ends(above[link])[0]
    return path


def find_tip(tree: ElementTree.Element, urdf: Path) -> str:
    """Find the link that tools are mounted on: the end of the longest chain of hinges.

    Grippers end the chain. Behind its last hinge a link that is called by convention (``tool0``,
    ``flange``, ``ee_link``) comes first, then the last one.

    Raises
    ------
    RobotError
        If nothing moves, or more than one chain could be the arm; the message names them.
    """
    links = _Links(tree)
    end, hinges = links.last_link(links.root)
    if links.choices(end) and hinges < _LEAST_ARM:
        ends = sorted(links.arm_ends(end, hinges), key=lambda one: -one[1])
        named = [f"--tip {links.flange_of(one)} ({count} hinges)" for one, count in ends]
        more = f" and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
        raise RobotError(
            f"{urdf}: tip: more than one chain could be the arm; give one of "
            f"{', '.join(named[:_MOST_NAMED])}{more}"
        )
    if hinges == 0:
        raise RobotError(f"{urdf}: tip: no hinge moves any link; expected an arm")
    return links.flange_of(end)


def _is_arm_joint(joint: ElementTree.Element) -> bool:
    """Tell whether an arm may move by a joint."""
    return joint.get("type") in _HINGES and joint.find("mimic") is None


class _Links:
    """The tree of links of a URDF."""

    def __init__(self, tree: ElementTree.Element) -> None:
        joints = tree.findall("joint")
        self.below: dict[str, list[ElementTree.Element]] = {name: [] for name in link_names(tree)}
        for joint in joints:
            self.below[joint_ends(joint)[0]].append(joint)
        children = {joint_ends(joint)[1] for joint in joints}
        self.root = next(name for name in self.below if name not in children)
        self.depth: dict[str, int] = {}
        for link in reversed(list(self._downwards(self.root))):
            self.depth[link] = max((depth for _, depth in self.branches(link)), default=0)

    def _downwards(self, root: str) -> Iterator[str]:
        """Yield a link and all below it, those above first."""
        waiting = [root]
        for link in waiting:
            yield link
            waiting += [joint_ends(joint)[1] for joint in self.below[link]]

    def branches(self, link: str) -> list[tuple[ElementTree.Element, int]]:
        """Return the joints below a link by which hinges hang on it, and how many in a row."""
        found = []
        for joint in self.below[link]:
            if joint.find("mimic") is not None or self._is_gripper(joint):
                continue
            depth = self.depth.get(joint_ends(joint)[1], 0) + _is_arm_joint(joint)
            if depth > 0:
                found.append((joint, depth))
        return found

    def choices(self, link: str) -> list[ElementTree.Element]:
        """Return the joints below a link of which more than one could lead to the arm's end."""
        branches = sorted(self.branches(link), key=lambda one: -one[1])
        if len(branches) < 2 or branches[1][1] <= branches[0][1] / 2:
            return []
        return [joint for joint, _ in branches]

    def last_link(self, link: str) -> tuple[str, int]:
        """Follow the longest chain to where it ends or parts; return that link and the hinges."""
        hinges = 0
        while not self.choices(link) and (branches := self.branches(link)):
            joint = max(branches, key=lambda one: one[1])[0]
            hinges += _is_arm_joint(joint)
            link = joint_ends(joint)[1]
        return link, hinges

    def arm_ends(self, link: str, hinges: int) -> list[tuple[str, int]]:
        """Return where all chains end that part above a hand, and how many hinges lead there."""
        choice = self.choices(link)
        if not choice or hinges >= _LEAST_ARM:
            return [(link, hinges)]
        found = []
        for joint in choice:
            end, more = self.last_link(joint_ends(joint)[1])
            found += self.arm_ends(end, hinges + _is_arm_joint(joint) + more)
        return found

    def _is_gripper(self, joint: ElementTree.Element) -> bool:
        """Tell whether a moving joint is called like a gripper's, or moves what is and ends there.

        An arm's last link may be called so too: its fingers hang on it.
        """
        if joint.get("type") == "fixed":
            return False
        child = joint_ends(joint)[1]
        ends = all(one.get("type") == "fixed" for one in self.below[child])
        return bool(_GRIPPER.search(joint.get("name", "")) or (ends and _GRIPPER.search(child)))

    def flange_of(self, link: str) -> str:
        """Choose the link that tools are mounted on among those that are fixed to the last one."""
        links = [link]
        for one in links:
            fixed = [joint for joint in self.below[one] if joint.get("type") == "fixed"]
            links += [joint_ends(joint)[1] for joint in fixed]
        candidates = [one for one in links if not _SENSOR.search(one)] or links
        for words in _FLANGES:
            for one in candidates:
                if words.search(one):
                    return one
        # A palm, or else the end of the longest row of fixed links.
        for one in candidates:
            if any(joint.get("type") != "fixed" for joint in self.below[one]):
                return one
        return candidates[-1]
