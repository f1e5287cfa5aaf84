"""The table of what any arm must reach, of what `benchmarks/robots.py` has measured."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

Row = dict[str, object]
median = statistics.median


def _column(rows: Sequence[Row], key: str) -> list[float]:
    """Return the values of a key, of the rows that have it."""
    return [float(row[key]) for row in rows if key in row]  # type: ignore[arg-type]


def taken(rows: Sequence[Row], refused: Sequence[str]) -> list[tuple[str, str, str]]:
    """How many came in, and how long that took."""
    seconds, cpu = _column(rows, "seconds"), _column(rows, "cpu_s")
    return [
        ("taken by the first command, no option but the file",
         f"{len(rows)} of {len(rows) + len(refused)}", "95 %"),
        ("`robots add`, median / most",
         f"{median(seconds):.1f} / {max(seconds):.1f} s ({median(cpu):.1f} / {max(cpu):.1f} s of "
         "CPU)", "5 / 15 s"),
    ]  # fmt: skip


def throws(rows: Sequence[Row]) -> list[tuple[str, str, str]]:
    """What the 16 throws came to, and what mapping cost."""
    fit = [row for row in rows
           if row.get("published") and float(row["reach"]) >= 0.5]  # type: ignore[arg-type]  # fmt: skip
    if not fit:
        return []
    mapped, bad = _column(fit, "mapped"), sum(_column(rows, "bad"))
    found = [
        (f"throws mapped of 16, median / least ({len(fit)} arms of 0.5 m reach, speeds not "
         "assumed)", f"{median(mapped):.0f} / {min(mapped):.0f}", "14"),
        ("samples outside a limit or touching, all arms", f"{bad:.0f}", "0"),
    ]  # fmt: skip
    for n, bar in ((6, "1.5"), (7, "3")):
        ratios = _column([row for row in fit if row["n"] == n], "to_ur5")
        if ratios:
            found.append((f"CPU of mapping to the UR5's, {n} joints, median / most ({len(ratios)} "
                          "arms)", f"{median(ratios):.1f} / {max(ratios):.1f}", bar))  # fmt: skip
    return found


def shapes(rows: Sequence[Row], poses: int) -> list[tuple[str, str, str]]:
    """How capsules compare with meshes."""
    missed, lost = _column(rows, "missed"), _column(rows, "lost")
    found = []
    if missed:
        found.append((f"clear by capsules though meshes touch, {poses} poses of {len(missed)} arms",
                      f"{sum(missed):.0f}", "0"))  # fmt: skip
    if lost:
        found.append(("touching by capsules though meshes are clear by 1 cm, median / most",
                      f"{median(lost):.1%} / {max(lost):.1%}", "5 % / 15 %"))  # fmt: skip
    return found


def formats(apart_mm: Sequence[float]) -> list[tuple[str, str, str]]:
    """How far the hands of MJCF and URDF are apart."""
    if not apart_mm:
        return []
    said = f"MJCF against URDF of the same arm, the hand on one throw's path, {len(apart_mm)} arms"
    return [(said, f"{max(apart_mm):.6f} mm at most", "1 mm")]


def inverse_kinematics() -> list[tuple[str, str, str]]:
    """Return poses a second to mink's, of `benchmarks/inverse_kinematics.py`."""
    from inverse_kinematics import compare, make_paths

    paths, found = make_paths(), []
    for name, n in (("ur5", 6), ("iiwa7", 7)):
        ratio = compare(name, paths).get("mink")
        said = "mink is not installed" if ratio is None else f"{ratio:.0f}"
        found.append((f"inverse kinematics, ratio to mink, {n} joints ({name})", said, "100"))
    return found


def print_table(entries: Sequence[tuple[str, str, str]]) -> None:
    """Print figures, what was measured and the bars as a table of Markdown."""
    print("\n| figure | measured | bar |\n|---|---|---|")
    for entry in entries:
        print(f"| {' | '.join(entry)} |")
