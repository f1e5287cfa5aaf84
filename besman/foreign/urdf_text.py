"""URDF from anywhere: one tree of links, no entities, and numbers that an arm can have."""

from __future__ import annotations

import re
from dataclasses import dataclass
from xml.etree import ElementTree

from besman.foreign.names import fault_of_part_name
from besman.foreign.numbers import parse_number

DEEPEST = 64
"""Elements in each other; a URDF needs six."""

MOST_CHARACTERS = 20_000_000
"""Of a whole URDF; meshes are files of their own."""


@dataclass(frozen=True)
class UrdfRange:
    """What the numbers of an attribute may be.

    Attributes
    ----------
    element, attribute : str
    count : int
        How many numbers it has.
    low, high : float
        Least and greatest of each, in SI units.
    """

    element: str
    attribute: str
    count: int
    low: float
    high: float

    @property
    def words(self) -> str:
        """For example ``-100 to 100``."""
        return f"{self.low:g} to {self.high:g}"


RANGES = (
    UrdfRange("origin", "xyz", 3, -100.0, 100.0),
    UrdfRange("origin", "rpy", 3, -1000.0, 1000.0),
    UrdfRange("axis", "xyz", 3, -1000.0, 1000.0),
    UrdfRange("mass", "value", 1, 0.0, 1e4),
    *(
        UrdfRange("inertia", f"i{axes}", 1, -1e6, 1e6)
        for axes in ["xx", "yy", "zz", "xy", "xz", "yz"]
    ),
    UrdfRange("cylinder", "radius", 1, 0.0, 10.0),
    UrdfRange("cylinder", "length", 1, 0.0, 100.0),
    UrdfRange("capsule", "radius", 1, 0.0, 10.0),
    UrdfRange("capsule", "length", 1, 0.0, 100.0),
    UrdfRange("sphere", "radius", 1, 0.0, 10.0),
    UrdfRange("box", "size", 3, 0.0, 100.0),
    UrdfRange("mesh", "scale", 3, -1e6, 1e6),
    UrdfRange("mimic", "multiplier", 1, -1e6, 1e6),
    UrdfRange("mimic", "offset", 1, -1e6, 1e6),
)
"""The numbers of a URDF that are looked at.

Limits of joints are held against the ranges of a robot.yaml: a URDF may have other joints, too.
"""

_BY_ELEMENT: dict[str, list[UrdfRange]] = {}
for _one in RANGES:
    _BY_ELEMENT.setdefault(_one.element, []).append(_one)

# Of elements, and of attributes in front of their values.
_PREFIXED = re.compile(r"""<([A-Za-z_][\w.-]*):|\s([A-Za-z_][\w.-]*):[\w.-]+\s*=\s*["']""")
_DECLARED = re.compile(r"""\sxmlns:([A-Za-z_][\w.-]*)\s*=""")
_ROOT = re.compile(r"<robot(?=[\s>])")
_MOST_PREFIXES = 20

# Nothing is declared: no recording or arm needs it.
_DECLARATION = re.compile(r"<!\s*(DOCTYPE|ENTITY)", re.IGNORECASE)


class UrdfTextError(ValueError):
    """Text that is no URDF, or not of an arm."""


class _Builder(ElementTree.TreeBuilder):
    """Builds a tree that is not too deep."""

    def __init__(self) -> None:
        super().__init__()
        self.depth = 0

    def start(self, tag: str, attrs: dict[str, str]) -> ElementTree.Element:
        """Open an element."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise UrdfTextError(f"elements lie in each other more than {DEEPEST} levels deep")
        return super().start(tag, attrs)

    def end(self, tag: str) -> ElementTree.Element:
        """Close an element."""
        self.depth -= 1
        return super().end(tag)


def parse_urdf(text: str) -> ElementTree.Element:
    """Parse a URDF.

    Parameters
    ----------
    text : str

    Returns
    -------
    Element
        ``<robot>``. Its links are one tree, its names printable, its numbers within the ranges of
        the page *Valid ranges*.

    Raises
    ------
    UrdfTextError
        If it is no such URDF.
    """
    if len(text) > MOST_CHARACTERS:
        raise UrdfTextError(f"expected a URDF of at most {MOST_CHARACTERS // 10**6} MB")
    if _DECLARATION.search(text):
        raise UrdfTextError("document types and entities are not allowed in a URDF")
    text = _declare_prefixes(text)
    try:
        # Entities are refused above.
        parser = ElementTree.XMLParser(target=_Builder())  # noqa: S314
        parser.feed(text)
        tree: ElementTree.Element = parser.close()
    except ElementTree.ParseError as error:
        raise UrdfTextError(f"not valid XML: {error}") from None
    except UrdfTextError:
        raise
    except (ValueError, LookupError) as error:
        raise UrdfTextError(f"not valid XML: {error}") from None
    if tree.tag != "robot" or tree.find("link") is None:
        got = "" if tree.tag == "robot" else f", got <{tree.tag:.40}>"
        if tree.tag == "mujocoinclude":
            got += ": a part of a MJCF; give the file that includes it"
        raise UrdfTextError(f"cannot be used as URDF: expected <robot> with links{got}")
    _check_names(tree)
    _check_tree(tree)
    _check_numbers(tree, "")
    return tree


def _declare_prefixes(text: str) -> str:
    """Declare the prefixes that nothing declares, as files that xacro wrote leave behind."""
    used = {name for pair in _PREFIXED.findall(text) for name in pair if name}
    missing = sorted(used - {"xmlns", "xml"} - set(_DECLARED.findall(text)))
    root = _ROOT.search(text)
    if not missing or root is None or len(missing) > _MOST_PREFIXES:
        return text
    named = "".join(f' xmlns:{name}="urn:undeclared:{name}"' for name in missing)
    return f"{text[: root.end()]}{named}{text[root.end() :]}"


def link_names(tree: ElementTree.Element) -> list[str]:
    """Return the names of all links."""
    return [str(link.get("name")) for link in tree.findall("link")]


def joint_ends(joint: ElementTree.Element) -> tuple[str, str]:
    """Return the names of a joint's parent and child link ("" where there is none)."""
    ends = []
    for tag in ("parent", "child"):
        element = joint.find(tag)
        ends.append("" if element is None else element.get("link", ""))
    return ends[0], ends[1]


def _check_names(tree: ElementTree.Element) -> None:
    """Refuse names of links and joints that are none, or that are there twice."""
    for tag in ("link", "joint"):
        seen = set[str]()
        for element in tree.findall(tag):
            name = element.get("name", "")
            fault = fault_of_part_name(name) or ("is there twice" if name in seen else None)
            if fault is not None:
                raise UrdfTextError(f"{tag} {name!r:.60}: the name {fault}")
            seen.add(name)


def _check_tree(tree: ElementTree.Element) -> None:
    """Refuse links that hang on themselves, on two joints or on nothing."""
    links = dict.fromkeys(link_names(tree))
    parents: dict[str, str] = {}
    for joint in tree.findall("joint"):
        name, (parent, child) = joint.get("name"), joint_ends(joint)
        for link in (parent, child):
            if link not in links:
                raise UrdfTextError(f"joint {name}: no link {link!r:.60} in the URDF")
        if child in parents:
            raise UrdfTextError(
                f"loop: link {child!r} hangs on {parents[child]!r} and, by joint {name}, "
                f"on {parent!r}; a URDF is a tree"
            )
        parents[child] = parent
    safe = set[str]()
    for link in links:
        above = [link]
        while above[-1] in parents and above[-1] not in safe and len(above) <= len(links):
            above.append(parents[above[-1]])
        if len(above) > len(links):
            raise UrdfTextError(f"loop: link {link!r} hangs on itself; a URDF is a tree")
        safe.update(above)
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        raise UrdfTextError(f"expected one link that hangs on nothing, got {', '.join(roots)}")


def _check_numbers(element: ElementTree.Element, place: str, moves: bool = True) -> None:
    """Refuse numbers that no arm has, in an element and what is in it."""
    if element.tag in ("link", "joint"):
        place = f"{element.tag} {element.get('name')}: "
        moves = element.get("type") != "fixed"
    for allowed in _BY_ELEMENT.get(str(element.tag), ()):
        text = element.get(allowed.attribute)
        if text is not None:
            where = f"{place}<{element.tag}> {allowed.attribute}"
            values = _check_attribute(text, allowed, where)
            if element.tag == "axis" and moves and sum(value * value for value in values) < 1e-12:
                raise UrdfTextError(f"{where}: got {text!r:.60}, expected a direction")
    for child in element:
        _check_numbers(child, place, moves)


def _check_attribute(text: str, allowed: UrdfRange, where: str) -> list[float]:
    """Return the numbers of an attribute; refuse what is none, or out of range."""
    try:
        values = [parse_number(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != allowed.count:
        number = "a number" if allowed.count == 1 else f"{allowed.count} numbers"
        raise UrdfTextError(f"{where}: got {text!r:.60}, expected {number}")
    if not all(allowed.low <= value <= allowed.high for value in values):
        raise UrdfTextError(f"{where}: got {text!r:.60}, expected {allowed.words}")
    return values
