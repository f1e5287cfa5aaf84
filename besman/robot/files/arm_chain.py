"""Which joints of a URDF are the arm, and which link is its flange."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from besman.exceptions import RobotError, nearest
from besman.foreign.urdf_text import joint_ends, link_names
from besman.robot.files.arm_base import HINGES, mobile_base_joints, split_at_base

# What is called so takes things: it is moved by no arm's trajectory. The first are moved against
# each other, the second carry them, and an arm's last hinge may turn these as a whole.
_FINGER = re.compile(r"finger|jaw|knuckle|thumb|claw|pinch|leaf|_pad", re.IGNORECASE)
_GRIPPER = re.compile(rf"gripper|palm|{_FINGER.pattern}", re.IGNORECASE)
_WRIST = re.compile(r"wrist|roll|pitch|yaw|rotat", re.IGNORECASE)
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
# Of so many parts that move by themselves a hand consists.
_LEAST_FINGERS = 3
# Two of more hinges than a finger and a head may hang on a torso.
_LONGEST_FINGER, _MOST_ARMS = 4, 3
_FEWEST_HINGES = 3
_MOST_NAMED = 8


def find_chain(
    tree: ElementTree.Element, tip: str, urdf: Path, base: str | None = None
) -> list[ElementTree.Element]:
    """Return the hinges from the base to a link; sliding joints between them are held.

    Parameters
    ----------
    tree : Element
    tip : str
    urdf : Path
        Named in errors.
    base : str, optional
        See `split_at_base`.

    Raises
    ------
    RobotError
        If a link is not there, no hinge moves it, or a joint follows another one (``<mimic>``).
    """
    _, path = split_at_base(tree, tip, urdf, base)
    chain = [joint for joint in path if joint.get("type") in HINGES]
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


def held_joints(
    tree: ElementTree.Element, tip: str, urdf: Path, base: str | None = None
) -> list[ElementTree.Element]:
    """Return the joints above a tip that could move and do not: the base's, and sliding ones."""
    below, path = split_at_base(tree, tip, urdf, base)
    return [
        *(joint for joint in below if joint.get("type") != "fixed"),
        *(joint for joint in path if joint.get("type") not in (*HINGES, "fixed")),
    ]


def find_tip(tree: ElementTree.Element, urdf: Path, base: str | None = None) -> str:
    """Find the link that tools are mounted on: the end of the longest chain of hinges.

    Grippers and hands end the chain. Behind its last hinge a link that is called by convention
    (``tool0``, ``flange``, ``ee_link``) comes first, then the last one.

    Parameters
    ----------
    tree : Element
    urdf : Path
        Named in errors.
    base : str, optional
        Link that the chain starts from; without it the root, and what drives that about is left
        out.

    Raises
    ------
    RobotError
        If nothing moves, the base is not there, or more than one chain could be the arm, or it is
        short beside what else moves; the message names them.
    """
    if base is not None and base not in link_names(tree):
        raise RobotError(f"{urdf}: base: no link {base!r}; {nearest(base, link_names(tree))}")
    links = _Links(tree, base)
    end, hinges = links.last_link(links.root)
    if links.parts_into_arms(end, hinges):
        ends = sorted(links.arm_ends(end, hinges), key=lambda one: -one[1])
        named = [f"--tip {links.flange_of(one)} ({count} hinges)" for one, count in ends]
        more = f" and {len(named) - _MOST_NAMED} more" if len(named) > _MOST_NAMED else ""
        raise RobotError(
            f"{urdf}: tip: more than one chain could be the arm; give one of "
            f"{', '.join(named[:_MOST_NAMED])}{more}"
        )
    if hinges == 0:
        left = [str(one.get("name")) for one in tree.findall("joint") if one.get("type") in HINGES]
        more = f" but fingers, or what drives a base ({', '.join(left[:3])}); or --tip LINK"
        raise RobotError(
            f"{urdf}: tip: no hinge moves any link; expected an arm{more if left else ''}"
        )
    tip = links.flange_of(end)
    others = len(links.moving_beside(end))
    if hinges < _FEWEST_HINGES and others:
        raise RobotError(
            f"{urdf}: tip: the longest chain has {hinges} hinges (--tip {tip}), and {others} more "
            f"joints move beside it; expected an arm of {_FEWEST_HINGES} hinges, or --tip LINK"
        )
    return tip


def _is_arm_joint(joint: ElementTree.Element) -> bool:
    """Tell whether an arm may move by a joint."""
    return joint.get("type") in HINGES and joint.find("mimic") is None


class _Links:
    """The tree of links of a URDF."""

    def __init__(self, tree: ElementTree.Element, base: str | None) -> None:
        joints = tree.findall("joint")
        drives = mobile_base_joints(tree) if base is None else set()
        self.hinges = {
            str(joint.get("name"))
            for joint in joints
            if _is_arm_joint(joint) and joint.get("name") not in drives
        }
        self.above = {joint_ends(joint)[1]: joint for joint in joints}
        self.below: dict[str, list[ElementTree.Element]] = {name: [] for name in link_names(tree)}
        for joint in joints:
            self.below[joint_ends(joint)[0]].append(joint)
        self.root = base or next(name for name in self.below if name not in self.above)
        self.movable: dict[str, bool] = {}
        self.depth: dict[str, int] = {}
        for link in reversed(list(self._downwards(self.root))):
            self.movable[link] = any(self._moves(joint) for joint in self.below[link])
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
            depth = self.depth.get(joint_ends(joint)[1], 0) + self._is_hinge(joint)
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
            if hinges >= _LEAST_ARM and self._is_hand(link):
                break
            joint = max(branches, key=lambda one: one[1])[0]
            hinges += self._is_hinge(joint)
            link = joint_ends(joint)[1]
        return link, hinges

    def parts_into_arms(self, link: str, hinges: int) -> bool:
        """Tell whether so few hinges are above a link, or so many below it, that arms part there.

        Above a hand there is an arm; its fingers are short, or more than arms and a head.
        """
        if not self.choices(link):
            return False
        depths = sorted(depth for _, depth in self.branches(link))
        are_arms = depths[-2] > _LONGEST_FINGER and len(depths) <= _MOST_ARMS
        return hinges < _LEAST_ARM or are_arms

    def arm_ends(self, link: str, hinges: int) -> list[tuple[str, int]]:
        """Return where all chains end that part above a hand, and how many hinges lead there."""
        if not self.parts_into_arms(link, hinges):
            return [(link, hinges)]
        found = []
        for joint in self.choices(link):
            end, more = self.last_link(joint_ends(joint)[1])
            found += self.arm_ends(end, hinges + self._is_hinge(joint) + more)
        return found

    def moving_beside(self, end: str) -> list[ElementTree.Element]:
        """Return what moves by itself and is neither above a link nor below it."""
        own = {id(self.above[one]) for one in self._upwards(end) if one in self.above}
        own |= {id(joint) for one in self._downwards(end) for joint in self.below[one]}
        return [
            joint
            for one in self._downwards(self.root)
            for joint in self.below[one]
            if joint.get("type") != "fixed" and joint.find("mimic") is None and id(joint) not in own
        ]

    def _upwards(self, link: str) -> Iterator[str]:
        """Yield a link and all above it."""
        yield link
        while link in self.above:
            link = joint_ends(self.above[link])[0]
            yield link

    def _is_hinge(self, joint: ElementTree.Element) -> bool:
        """Tell whether a joint is a hinge that an arm may move by."""
        return str(joint.get("name")) in self.hinges

    def _moves(self, joint: ElementTree.Element) -> bool:
        """Tell whether something moves by a joint, or below it."""
        return joint.get("type") != "fixed" or self.movable.get(joint_ends(joint)[1], False)

    def _is_hand(self, link: str) -> bool:
        """Tell whether so many moving parts hang on a link that they can but be fingers."""
        return sum(self._moves(joint) for joint in self.below[link]) >= _LEAST_FINGERS

    def _is_gripper(self, joint: ElementTree.Element) -> bool:
        """Tell whether a moving joint is called like a gripper's, or moves what is and ends there.

        An arm's last link may be called so too: its fingers hang on it, or it alone is moved.
        """
        name, child = joint.get("name", ""), joint_ends(joint)[1]
        if joint.get("type") == "fixed":
            return False
        if _FINGER.search(name) or (_GRIPPER.search(name) and not _WRIST.search(name)):
            return True
        if not self._ends(child):
            return False
        return bool(_FINGER.search(child) or (_GRIPPER.search(child) and not self._is_alone(joint)))

    def _ends(self, link: str) -> bool:
        """Tell whether nothing that moves by itself hangs on a link and what is fixed to it."""
        return not any(
            joint.get("type") != "fixed" and joint.find("mimic") is None
            for one in self._fixed_to(link)
            for joint in self.below[one]
        )

    def _is_alone(self, joint: ElementTree.Element) -> bool:
        """Tell whether the link that a joint hangs on moves nothing else and carries no gripper."""
        parent = joint_ends(joint)[0]
        moved = sum(one.get("type") != "fixed" for one in self.below[parent])
        return moved == 1 and not any(_GRIPPER.search(one) for one in self._fixed_to(parent))

    def _fixed_to(self, link: str) -> list[str]:
        """Return a link and what is fixed to it below, those above first."""
        links = [link]
        for one in links:
            fixed = [joint for joint in self.below[one] if joint.get("type") == "fixed"]
            links += [joint_ends(joint)[1] for joint in fixed]
        return links

    def flange_of(self, link: str) -> str:
        """Choose the link that tools are mounted on among those that the last hinge moves."""
        while link in self.above and self.above[link].get("type") == "fixed":
            link = joint_ends(self.above[link])[0]
        links = self._fixed_to(link)
        candidates = [
            one for one in links if not _SENSOR.search(one) and not _FINGER.search(one)
        ] or links
        for words in _FLANGES:
            for one in candidates:
                if words.search(one):
                    return one
        # A palm, or else the end of the longest row of fixed links.
        for one in candidates:
            if any(joint.get("type") != "fixed" for joint in self.below[one]):
                return one
        return candidates[-1]
