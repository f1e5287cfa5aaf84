"""Recording files, whatever their format; and the table of formats.

A new format is a module of this folder with its reader, and an entry of `FORMATS`. Messages, help
texts, the page *My recording* and the tests go through the table; nothing else names a format.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from besman.exceptions import RecordingError, one_of, see_look
from besman.io.recordings.format import (
    READING,
    Columns,
    Format,
    Units,
    is_bag,
    is_c3d,
    is_keypoint_csv,
    is_keypoints,
    reading,
    text_begins,
    text_has,
)
from besman.io.warning import warn_of_file

if TYPE_CHECKING:
    from besman.records import Axis, LabelledRecording, Recording

_HEAD_BYTES = 16_384

FORMATS = (
    Format(
        "Qualisys TSV",
        (".tsv",),
        text_has(rb"^(FILE_VERSION|NO_OF_[A-Z]+|FREQUENCY|DATA_INCLUDED|MARKER_NAMES)(\t|\r?$)"),
        "qtm_tsv:read_tsv",
        "Qualisys Track Manager, old and new header; markers, 6D bodies, skeletons",
        writer="qtm_tsv:write_tsv",
        takes_columns=True,
        takes_partial=True,
        writes_zeros=True,
    ),
    Format(
        "C3D",
        (".c3d",),
        is_c3d,
        "c3d:read_c3d",
        "any camera system: Intel, DEC or SGI, floats or integers; gaps by their residual",
        writer="c3d:write_c3d",
        takes_units=True,
        takes_partial=True,
        writes_zeros=True,
    ),
    Format(
        "Xsens MVNX",
        (".mvnx",),
        text_begins(rb"<.*mvnx"),
        "mvnx:read_mvnx",
        "Xsens MVN: a suit with segments",
        takes_partial=True,
        has_one_up=True,
    ),
    Format(
        "TRC",
        (".trc",),
        text_begins(rb'"?PathFileType[\t ,;"]'),
        "trc:read_trc",
        "OpenSim, Motion Analysis, Pose2Sim, OpenCap: tabs, commas or blanks; says no up axis",
        takes_units=True,
        takes_partial=True,
        writes_zeros=True,
    ),
    Format(
        "Motive CSV",
        (".csv",),
        text_begins(rb'(?i)"?format version"?[\t ,;]'),
        "motive_csv:read_motive_csv",
        "OptiTrack Motive, format 1.21 to 1.25: rigid bodies, bones, markers; y-up as exported",
        takes_units=True,
        takes_partial=True,
        writes_zeros=True,
    ),
    Format(
        "Nexus CSV",
        (".csv",),
        text_begins(
            rb'(?i)"?(trajectories|model outputs|devices|joints|segments|objects)"?[,;\t ]*\r?\n'
            rb'"?[0-9]+(\.[0-9]+)?"?([,;\t ]*\r?$|[,;\t] *hz)'
            rb'|"?events"?[,;\t ]*\r?\n("?[0-9][^\n]*\n)?"?subject"?[,;\t]'
        ),
        "nexus_csv:read_nexus_csv",
        "Vicon Nexus, Workstation, Tracker: trajectories, positions among model outputs, objects",
        takes_units=True,
        takes_partial=True,
        writes_zeros=True,
    ),
    Format(
        "BVH",
        (".bvh",),
        text_begins(rb"(?i)HIERARCHY\s"),
        "bvh:read_bvh",
        "animation and suits: a skeleton with joints' angles; units by the height of the body",
        takes_units=True,
        takes_partial=True,
        turns_from_pose=True,
    ),
    Format(
        "keypoints JSON",
        (".json", ".jsonl"),
        is_keypoints,
        "keypoints:read_keypoints",
        "markerless systems: [{name: [x, y, z], ...}, ...]; rate as fps or times, units by height; "
        "or a folder with a file a frame (CMU Panoptic)",
        takes_units=True,
        takes_folders=True,
        writes_zeros=True,
    ),
    Format(
        "keypoints CSV",
        (".csv",),
        is_keypoint_csv,
        "keypoints_csv:read_keypoints_csv",
        "markerless systems, BTS (EMT), Visual3D (ASCII): name_x, name_y, name_z; names above x, "
        "y, z; or a row a keypoint; time or '# fps: 30'; units by height",
        takes_units=True,
        takes_partial=True,
        writes_zeros=True,
    ),
    Format(
        "joint log (CSV with '# urdf' and '# frames')",
        (".csv",),
        text_begins(rb"(?i)(#[^\n]*\n)*(# *(urdf|frames) *:|time_s *,)"),
        "exoskeleton:read_joint_log",
        "an exoskeleton; its URDF beside it, or the name of one of configs/exoskeleton",
        companions="exoskeleton:find_log_files",
        takes_partial=True,
        has_one_up=True,
    ),
    Format(
        "ROS bag",
        (".mcap", ".db3", ".bag"),
        is_bag,
        "ros_bag:read_bag",
        "ROS 2 (MCAP, SQLite), ROS 1: joint states with URDF, poses, tf; pip install 'besman[ros]'",
        companions="ros_bag:find_bag_files",
        has_one_up=True,
    ),
)
"""All formats there are."""


KNOWN_FORMATS = one_of(entry.name for entry in FORMATS)
"""What can be read, for messages and help texts."""

WRITTEN_SUFFIXES = tuple(entry.suffixes[0] for entry in FORMATS if entry.writer)
"""Endings of the files that can be written."""


def read_recording(
    path: Path,
    units: Units | None = None,
    partial: bool | None = None,
    up: Axis | None = None,
    *,
    rate_hz: float | None = None,
    subject: str | None = None,
    topics: Sequence[str] | None = None,
) -> Recording:
    """Read one recording; its content tells the format, whatever the file's ending.

    Parameters
    ----------
    path : Path
        Of one of `FORMATS`; or a folder whose files hold a frame each.
    units : "m", "cm", "mm" or "in", optional
        What the coordinates are in, whatever the file says, if its format may be wrong about it.
    partial : bool, optional
        Take what is there of a file that was cut in transfer, with a warning.
    up : str, optional
        The direction of the file's frame that points up, such as ``y`` or ``-z``; if not given,
        what the file says, or `besman.geometry.up_axis` finds.
    rate_hz : float, optional
        Frames per second, whatever the file says; of files that do not say it needed.
    subject : str, optional
        The one of several people or things whose trajectories are taken, besides those that are
        nobody's; see `besman.io.recordings.subjects`.
    topics : sequence of str, optional
        Topics of a bag of messages that are taken.

    Where an argument is not given it is what `reading` says around the call.

    Returns
    -------
    Recording
        At least two frames, with times that rise; metres, z up. `Recording.origin` says how
        that was told.

    Raises
    ------
    RecordingError
        If the file cannot be used; the message names file and line or frame.

    Warns
    -----
    RecordingWarning
        If samples that no body makes became gaps, and for what else was concluded: see
        `besman.io.recordings.plausibility.check_recording`, `besman.io.recordings.conventions` and
        the format's reader.
    """
    from besman.io.recordings.conventions import at_rate, leave_out_zeros, turn_up
    from besman.io.recordings.plausibility import check_recording
    from besman.io.recordings.subjects import take_subject

    if path.is_dir():
        # A recording is called by its name; "." has none.
        path = path.resolve() if path.name in ("", "..") else path
    is_folder = path.is_dir()
    head = b"" if is_folder else read_head(path)
    found = next(e for e in FORMATS if e.takes_folders) if is_folder else recognise(head)
    if found is None:
        what = "a format that is not known" if head.strip() else "the file is empty"
        more = see_look(str(path)) if head.strip() else ""
        raise RecordingError(f"{path}: {what}; expected {KNOWN_FORMATS}{more}")
    chosen = None if topics is None else tuple(topics)
    with reading(
        units=units, partial=partial, up=up, rate_hz=rate_hz, subject=subject, topics=chosen
    ):
        asked = READING.get()
        recording = found.read(path, asked.units, asked.partial)
    recording = at_rate(recording, asked.rate_hz)
    recording = take_subject(recording, asked.subject, path)
    if found.writes_zeros:
        recording = leave_out_zeros(recording)
    recording = turn_up(found.sign(recording), asked.up, path)
    return check_recording(recording, path)


def find_companions(path: Path) -> tuple[Path, ...]:
    """Return the files that a recording is read with besides its own.

    Parameters
    ----------
    path : Path
        A recording.

    Returns
    -------
    tuple of Path
        Of a joint log its URDF; nothing of another format.

    Raises
    ------
    RecordingError
        If the file cannot be read, or what it names is not there.
    """
    found = None if path.is_dir() else recognise(read_head(path))
    return () if found is None else found.find_companions(path)


def write_recording(
    recording: Recording | LabelledRecording, path: Path, beside: Columns | None = None
) -> None:
    """Write a recording; the path's ending chooses the format.

    Parameters
    ----------
    recording : Recording or LabelledRecording
        What to write. Gaps are written the way the format defines them.
    path : Path
        It ends in one of `WRITTEN_SUFFIXES`; replaced if it exists.
    beside : Columns, optional
        Trajectories of the same frames that are written behind those of the recording.

    Raises
    ------
    RecordingError
        If the ending is another one, the folder does not exist or the format cannot hold it.

    Warns
    -----
    RecordingWarning
        If the recording has orientations, which no format written here holds.
    """
    from besman.records import LabelledRecording, Recording

    if isinstance(recording, LabelledRecording):
        recording = Recording(
            time=recording.time,
            positions=recording.positions,
            names=recording.markers,
            rate_hz=recording.rate_hz,
            source=recording.source,
            first_frame=recording.first_frame,
            orientations=recording.orientations,
        )
    entry = find_writer(path)
    entry.write(recording, path, beside)
    if recording.orientations is not None:
        warn_of_file(f"{path.name}: {entry.name} holds positions alone; orientations are left out")


def find_writer(path: Path) -> Format:
    """Return the format in which a file of this name is written.

    Raises
    ------
    RecordingError
        If the ending is not that of one.
    """
    ending = path.suffix.lower()
    found = next((one for one in FORMATS if one.writer and one.suffixes[0] == ending), None)
    if found is None:
        raise RecordingError(
            f"{path}: cannot be written: the ending must be {one_of(WRITTEN_SUFFIXES)}"
        )
    return found


def read_head(path: Path) -> bytes:
    """Return the start of a file, 16 kB.

    Raises
    ------
    RecordingError
        If it is not there or cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except FileNotFoundError:
        raise RecordingError(f"{path}: no such file") from None
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None


def recognise(head: bytes) -> Format | None:
    """Tell the format of a file from its first bytes; None if none is like it.

    Parameters
    ----------
    head : bytes
        The first 16 kB, or all there is.
    """
    return next((entry for entry in FORMATS if entry.sniff(head)), None)
