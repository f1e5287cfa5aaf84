"""Recordings as other programs write them: each format by code that knows nothing of its reader.

Positions are given in metres with z up, and laid into the frame that a format's programs use.
"""

import json

import numpy as np


def y_up(positions):
    """Return positions (..., 3) of a frame with z up in one with y up, turned about x."""
    return np.stack([positions[..., 0], positions[..., 2], -positions[..., 1]], axis=-1)


def number(value, digits=6):
    return "" if np.isnan(value) else f"{value + 0.0:.{digits}f}"


def rows_of(recording, positions, digits=6, with_time=True, sep="\t"):
    rows = []
    for at, row in enumerate(positions.reshape(len(positions), -1)):
        first = [str(recording.first_frame + at)]
        if with_time:
            first.append(f"{recording.time[at]:.6f}")
        rows.append(sep.join([*first, *(number(value, digits) for value in row)]))
    return rows


def trc_lines(recording, sep="\t", units="mm", scale=1000.0, n_markers=None, blank="", up="y", names=None, digits=6):  # noqa: E501  # fmt: skip
    """TRC as OpenSim has it."""
    positions = (y_up(recording.positions) if up == "y" else recording.positions) * scale
    names = [name or "" for name in names or recording.names]
    n, m = len(positions), len(names)
    rate = f"{recording.rate_hz:g}"
    return [
        sep.join(["PathFileType", "4", "(X/Y/Z)", "a.trc"]),
        sep.join(["DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate",
                  "OrigDataStartFrame", "OrigNumFrames"]),
        sep.join([rate, rate, str(n), str(n_markers or m), units, rate, "1", str(n)]),
        sep.join(["Frame#", "Time", *(f"{name}{2 * sep}" for name in names)]),
        sep.join(["", "", *(f"{axis}{k}" for k in range(1, m + 1) for axis in "XYZ")]),
        blank,
        *rows_of(recording, positions, digits, sep=sep),
    ]  # fmt: skip


def motive_lines(recording, version="1.23", units="Meters", scale=1.0, second="", time="Time (Seconds)", bodies=0, labels=True, parent=False, timecode=False, digits=9):  # noqa: E501  # fmt: skip
    """Motive CSV; the first of the trajectories are rigid bodies with their orientation."""
    positions = y_up(recording.positions) * scale
    head = f"Format Version,{version},Take Name,a,Capture Frame Rate,{2 * recording.rate_hz:.6f},"
    head += f"Export Frame Rate,{recording.rate_hz:.6f},Total Exported Frames,{len(positions)},"
    head += f"Rotation Type,Quaternion,Length Units,{units},Coordinate Space,Global"
    kinds, names, ids, what, axes = [], [], [], [], []
    for k, name in enumerate(recording.names):
        n = 8 if k < bodies else 3
        kinds += n * ["Rigid Body" if k < bodies else "Marker"]
        names += n * [f'"{name}"' if name else f"Unlabeled {1000 + k}"]
        ids += n * [f"{k:04X}"]
        what += (4 * ["Rotation"] if k < bodies else []) + 3 * ["Position"]
        axes += list("XYZWXYZ" if k < bodies else "XYZ")
        if k < bodies:
            what.append("Mean Marker Error")
            axes.append("")
    rows = []
    for at in range(len(positions)):
        cells = [str(recording.first_frame + at), f"{recording.time[at]:.6f}"]
        cells += ["12:00:00:01"] if timecode else []
        for k in range(len(recording.names)):
            if k < bodies:
                w, x, y, z = recording.orientations[at, k]
                # About the same vertical, which is y in the file.
                cells += [number(one) for one in (x, z, -y, w)]
            cells += [number(one, digits) for one in positions[at, k]]
            cells += ["0.0005"] if k < bodies else []
        rows.append(",".join(cells))
    blank = [""] if timecode else []
    said = ["Type", "Name", "ID", "Parent"] if labels else ["", "", "", ""]
    header = [
        ",".join(["", said[0], *blank, *kinds]),
        ",".join(["", said[1], *blank, *names]),
        ",".join(["", said[2], *blank, *ids]),
        *([",".join(["", said[3], *blank, *["" for _ in ids]])] if parent else []),
        ",".join(["", "", *blank, *what]),
        ",".join(["Frame", time, *(["TimeCode (Optical)"] if timecode else []), *axes]),
    ]
    return [head, *([] if second is None else [second]), *header, *rows]


def nexus_lines(recording, title="Trajectories", subject="S1:", commas=0, units=True, first="Frame,Sub Frame", rate=None, digits=6):  # noqa: E501  # fmt: skip
    """Nexus CSV: a table of trajectories."""
    tail = commas * ","
    two = "," in first
    names = [f"{subject}{name}" if name else "" for name in recording.names]
    lead = ",," if two else ","
    rows = rows_of(recording, recording.positions * 1000.0, digits, with_time=False, sep=",")
    if two:
        rows = [row.replace(",", ",0,", 1) for row in rows]
    return [
        title + tail,
        f"{recording.rate_hz:g}{tail}" if rate is None else rate,
        lead + ",,,".join(names) + ",,",
        ",".join([first, *("X,Y,Z" for _ in names)]),
        *([lead + ",".join("mm,mm,mm" for _ in names)] if units else []),
        *rows,
    ]


def bvh_lines(recording, order="ZXY", turns=None, scale=1.0, offsets=None):
    """BVH: a chain of joints with six channels each, y up."""
    positions = y_up(recording.positions) * scale
    n, m = positions.shape[:2]
    turns = np.zeros((n, m, 3)) if turns is None else turns
    lines = ["HIERARCHY"]
    for k, name in enumerate(recording.names):
        offset = (0, 0, 0) if offsets is None else offsets[k]
        lines += [f"{'ROOT' if k == 0 else 'JOINT'} {name}", "{",
                  "OFFSET " + " ".join(f"{one:.6f}" for one in offset),
                  "CHANNELS 6 Xposition Yposition Zposition "
                  + " ".join(f"{axis}rotation" for axis in order)]  # fmt: skip
    lines += ["}" for _ in recording.names]
    lines += ["MOTION", f"Frames: {n}", f"Frame Time: {1 / recording.rate_hz:.7f}"]
    before = np.concatenate([np.zeros((n, 1, 3)), positions[:, :-1]], axis=1)
    for at in range(n):
        cells = np.concatenate([positions[at] - before[at], turns[at]], axis=1).ravel()
        lines.append(" ".join(f"{value + 0.0:.9f}" for value in cells))
    return lines


def six_d_lines(recording, name_cells="with", order=("Yaw", "Pitch", "Roll"), columns=True):
    """Qualisys 6D: the name of a body in a cell of its own, with an empty one below it or none."""
    from scipy.spatial.transform import Rotation

    head = [f"NO_OF_FRAMES\t{len(recording.time)}", "NO_OF_BODIES\t" + str(len(recording.names)),
            f"FREQUENCY\t{recording.rate_hz:g}", "DATA_INCLUDED\t6D",
            "\t".join(["BODY_NAMES", *recording.names])]  # fmt: skip
    rest = [*order, "Residual", *(f"Rot[{k}]" for k in range(9))]
    names = []
    for name in recording.names:
        names += (
            [f"{name} X", f"{name} Y", f"{name} Z"] if name_cells == "joined" else [name, *"XYZ"]
        )
        names += rest
    rows = []
    for at in range(len(recording.time)):
        cells = [str(recording.first_frame + at), f"{recording.time[at]:.6f}"] if columns else []
        for k in range(len(recording.names)):
            cells += [""] if name_cells == "with" else []
            if np.isnan(recording.positions[at, k, 0]):
                cells += 16 * [""]
                continue
            turn = Rotation.from_quat(recording.orientations[at, k], scalar_first=True)
            angles = turn.as_euler("ZYX", degrees=True)
            values = [
                *(1000 * recording.positions[at, k]),
                *angles,
                0.3,
                *turn.as_matrix().T.ravel(),
            ]
            cells += [number(value) for value in values]
        rows.append("\t".join(cells))
    return [*head, *(["\t".join(["Frame", "Time", *names])] if columns else []), *rows]


def keypoint_frames(recording, scale=1.0):
    """Keypoints as JSON can hold them: NaN for what was not seen."""
    return [
        {
            "frame": recording.first_frame + at,
            "time": round(float(recording.time[at]), 6),
            "keypoints": {
                name: [round(float(one), 9) for one in scale * row[k]]
                for k, name in enumerate(recording.names)
            },
        }
        for at, row in enumerate(recording.positions)
    ]


def keypoint_table(recording, sep=","):
    """Keypoints as a table."""
    names = [f"{name}_{axis}" for name in recording.names for axis in "xyz"]
    return ["# units: m", sep.join(["frame", "time", *names]),
            *rows_of(recording, recording.positions, digits=9, sep=sep)]  # fmt: skip


def write_lines(lines, path, end="\n"):
    path.write_bytes((end.join(lines) + end).encode())
    return path


def write_trc(recording, path):
    write_lines(trc_lines(recording), path)


def write_motive(recording, path):
    write_lines(motive_lines(recording), path)


def write_nexus(recording, path):
    write_lines(nexus_lines(recording), path)


def write_bvh(recording, path):
    write_lines(bvh_lines(recording), path)


def write_keypoints(recording, path):
    content = {"fps": recording.rate_hz, "units": "m", "frames": keypoint_frames(recording)}
    path.write_text(json.dumps(content) + "\n")


def write_keypoint_table(recording, path):
    write_lines(keypoint_table(recording), path)


def write_keypoint_rows(recording, path):
    """Write a row for each marker of each frame, in metres, as a data frame in long form."""
    lines = ["time,marker,x,y,z"]
    for at, frame in zip(recording.time, recording.positions, strict=True):
        for name, place in zip(recording.names, frame, strict=True):
            cells = ["" if np.isnan(one) else f"{one:.6f}" for one in place]
            lines.append(",".join([f"{at:.6f}", name, *cells]))
    write_lines(lines, path)


WRITERS = {
    "TRC": write_trc,
    "Motive CSV": write_motive,
    "Nexus CSV": write_nexus,
    "BVH": write_bvh,
    "keypoints JSON": write_keypoints,
    "keypoints CSV": write_keypoint_table,
}
