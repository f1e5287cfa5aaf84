import numpy as np
import pytest

from besman.config.yaml_file import parse_config
from besman.geometry.frames import back_frame, hand_frame
from besman.person.marker_set import MarkerSet, load_marker_set
from besman.person.point_frames import PointFrames
from besman.records import Recording
from besman.stages.label.stage import LabelConfig
from besman.stages.select.hand_trajectory import map_record

RATE_HZ = 50.0
BACK = {"left": ["left_shoulder"], "right": ["shoulder"], "bottom": ["pelvis"]}
BARE = {"shoulder": ["shoulder"], "elbow": ["elbow"], "wrist": ["wrist"]}
WHOLE = BARE | {
    "fingers": ["index", "little"],
    "thumb_side": ["index"],
    "little_side": ["little"],
}
NAMES = ("left_shoulder", "shoulder", "pelvis", "elbow", "wrist", "index", "little")


def turn(axis, angles):
    """Rotations about one axis, shape (T, 3, 3)."""
    c, s = np.cos(angles), np.sin(angles)
    found = np.zeros((len(angles), 3, 3))
    a, b = [one for one in range(3) if one != axis]
    found[:, axis, axis] = 1.0
    found[:, a, a] = found[:, b, b] = c
    found[:, a, b], found[:, b, a] = -s, s
    return found


def person(n=60, mirrored=False):
    """A person who turns and moves the hand; also the true hand2lab and where its middle is."""
    t = np.linspace(0.0, 1.0, n)
    stand = turn(2, 0.7 * t)
    hand2body = turn(2, 0.5 * np.sin(6 * t)) @ turn(0, 1.2 * t) @ turn(1, 0.4 * t)
    hand2lab = stand @ hand2body
    fixed = {"left_shoulder": (0, 0.2, 1.45), "shoulder": (0, -0.2, 1.45), "pelvis": (0, 0, 0.95)}
    points = {name: stand @ np.array(place) for name, place in fixed.items()}
    points["elbow"] = stand @ np.array([0.1, -0.25, 1.15])
    points["wrist"] = stand @ np.array([0.3, -0.2, 1.1]) + 0.1 * np.stack([t, t, t**2], axis=1)
    # Palm down, fingers forward, the index finger of a right hand is on the left.
    points["index"] = points["wrist"] + hand2lab @ np.array([0.09, 0.03, 0.0])
    points["little"] = points["wrist"] + hand2lab @ np.array([0.09, -0.03, 0.0])
    positions = np.stack([points[name] for name in NAMES], axis=1)
    middle = points["wrist"] + hand2lab @ np.array([0.045, 0.0, 0.0])
    return positions, hand2lab, middle, stand


def derive(positions, hand=WHOLE, back=BACK, names=NAMES, key="hand"):
    frames = parse_config({"back": back, key: hand}, PointFrames, "set.yaml")
    return frames.derive(positions, names, np.zeros(positions.shape[:2], dtype=np.bool_))


def of(found, *names):
    return [found.positions[:, found.names.index(name)] for name in names]


def test_two_knuckles_and_the_wrist_tell_the_hand():
    positions, hand2lab, middle, _ = person()
    found = derive(positions)
    rotation, origin = hand_frame(*of(found, "hand_top", "hand_left", "hand_right"))
    np.testing.assert_allclose(rotation, hand2lab, atol=1e-12)
    np.testing.assert_allclose(origin, middle, atol=1e-12)


def test_the_back_faces_where_the_person_does():
    positions, _, _, stand = person()
    rotation, origin = back_frame(*of(derive(positions), "back_top", "back_left", "back_right"))
    np.testing.assert_allclose(rotation, stand, atol=1e-12)
    # As right_arm.yaml has it for a person of 1.70 m whose shoulders are at the same height.
    expected = load_marker_set("right_arm").pose_m
    centre = np.mean([expected[f"back_{part}"] for part in ("top", "left", "right")], axis=0)
    centre -= [0.0, 0.0, expected["shoulder"][2]]
    np.testing.assert_allclose(origin, stand @ (centre + np.array([0, 0, 1.45])), atol=1e-12)


def test_without_the_lower_end_the_trunk_is_upright():
    positions, *_ = person()
    lean = positions.copy()
    lean[:, 2] += 0.3  # the pelvis is elsewhere: nobody looks
    back = {"left": ["left_shoulder"], "right": ["shoulder"]}
    np.testing.assert_allclose(
        derive(lean, back=back).positions, derive(positions, back=back).positions
    )


def test_a_left_hand_is_the_mirror_image_of_a_right_one():
    positions, *_ = person()
    plane = np.array([1.0, -1.0, 1.0])
    right = derive(positions, BARE)
    # The mirrored person's left arm: left and right shoulder have changed places.
    swapped = (NAMES[1], NAMES[0], *NAMES[2:])
    arm = {"shoulder": ["left_shoulder"], "elbow": ["elbow"], "wrist": ["wrist"]}
    left = derive(positions * plane, arm, names=swapped, key="left_hand")
    for one, other in (("top", "top"), ("left", "right"), ("right", "left")):
        (mirrored,) = of(left, f"left_hand_{one}")
        np.testing.assert_allclose(mirrored * plane, of(right, f"hand_{other}")[0], atol=1e-12)


def bare_arm(elbow_angles):
    """An arm whose upper arm hangs and whose elbow bends forwards; thumb up, as at rest."""
    n = len(elbow_angles)
    positions = np.zeros((n, len(NAMES), 3))
    positions[:, 0], positions[:, 1], positions[:, 2] = (0, 0.2, 1.4), (0, -0.2, 1.4), (0, 0, 0.9)
    positions[:, 3] = (0, -0.2, 1.1)
    forearm = np.stack([np.sin(elbow_angles), np.zeros(n), -np.cos(elbow_angles)], axis=1)
    positions[:, 4] = positions[:, 3] + 0.25 * forearm
    return positions, forearm


def test_without_fingers_the_thumb_lies_in_the_plane_of_the_elbow():
    positions, forearm = bare_arm(np.linspace(0.3, 2.2, 30))
    found = derive(positions, BARE)
    rotation, origin = hand_frame(*of(found, "hand_top", "hand_left", "hand_right"))
    np.testing.assert_allclose(rotation[..., 0], forearm, atol=1e-12)
    # The back of a right hand then faces right, away from the body.
    np.testing.assert_allclose(rotation[..., 2], np.tile([0.0, -1.0, 0.0], (30, 1)), atol=1e-12)
    np.testing.assert_allclose(origin, positions[:, 4] + 0.05 * forearm, atol=1e-12)


@pytest.mark.parametrize("angles", [np.zeros(20), np.linspace(0.9, -0.9, 41)])
def test_a_straight_arm_is_bridged(angles):
    positions, _ = bare_arm(np.abs(angles))
    rng = np.random.default_rng(0)
    straight = np.abs(angles) < 0.1
    positions[straight, 4] += 0.002 * rng.normal(size=(straight.sum(), 3))
    rotation, _ = hand_frame(*of(derive(positions, BARE), "hand_top", "hand_left", "hand_right"))
    assert (rotation[:, 1, 2] < -0.99).all()


def test_what_is_not_seen_or_filled_is_so_in_what_is_derived():
    positions, *_ = person(10)
    positions[3, NAMES.index("wrist")] = np.nan
    positions[5, NAMES.index("index")] = np.nan
    frames = parse_config({"back": BACK, "hand": WHOLE}, PointFrames, "set.yaml")
    filled = np.zeros(positions.shape[:2], dtype=np.bool_)
    filled[7, NAMES.index("wrist")] = True
    found = frames.derive(positions, NAMES, filled)
    hand = [found.names.index(f"hand_{part}") for part in ("top", "left", "right")]
    hidden = np.isnan(found.positions).any(axis=2)
    assert np.argwhere(hidden).tolist() == [[3, one] for one in sorted(hand)]
    # A finger alone goes along with the forearm.
    assert np.flatnonzero(found.filled[:, hand[0]]).tolist() == [5, 7]
    assert found.n_held == 1
    as_seen = frames.derive(positions, NAMES, filled, hold=False)
    assert np.isnan(as_seen.positions[5, hand]).all()
    assert as_seen.n_held == 0
    assert found.filled[7, hand].all()
    assert not found.filled[:, found.names.index("back_top")].any()


def test_what_is_assumed_is_said():
    whole = parse_config({"back": BACK, "hand": WHOLE}, PointFrames, "set.yaml")
    assert len(whole.find_assumptions(NAMES)) == 1
    said = " ".join(whole.find_assumptions(("left_shoulder", "shoulder", "elbow", "wrist")))
    for what in ("1.70 m", "trunk is upright", "5 cm beyond the wrist", "neither in nor out"):
        assert what in said
    assert whole.find_assumptions(("elbow",)) == ()


def test_an_arm_that_is_not_complete_is_left_out():
    positions, *_ = person(5)
    there = [NAMES.index(name) for name in NAMES if name != "elbow"]
    names = tuple(NAMES[one] for one in there)
    assert derive(positions[:, there], names=names).names == ("back_top", "back_left", "back_right")
    assert derive(positions[:, 3:], names=NAMES[3:]).names == ()


def test_a_stage_sees_the_hand_of_keypoints():
    positions, _, middle, stand = person()
    called = {"left_shoulder": "LShoulder", "shoulder": "RShoulder", "elbow": "RElbow",
              "wrist": "RWrist", "index": "RIndex", "little": "RPinky"}  # fmt: skip
    keep = [NAMES.index(name) for name in called]
    hips = stand @ np.array([0.0, 0.1, 0.9]), stand @ np.array([0.0, -0.1, 0.9])
    recording = Recording(
        np.arange(60) / RATE_HZ,
        np.concatenate((positions[:, keep], np.stack(hips, axis=1)), axis=1),
        (*called.values(), "LHip", "RHip"),
        RATE_HZ,
        "a.trc",
    )
    (labelled,) = LabelConfig(markers="halpe").run((recording,), load_marker_set("halpe"))
    assert labelled.markers[:3] == ("shoulder", "elbow", "wrist")
    found = map_record(labelled, (5, 50), "reach", name="a", cutoff_hz=1000.0, rate_hz=RATE_HZ)
    origin = back_frame(*(labelled.marker(f"back_{p}")[5] for p in ("top", "left", "right")))[1]
    np.testing.assert_allclose(found.poses[:, :3], (middle[5:50] - origin) @ stand[5], atol=1e-9)


def test_frames_name_markers_of_the_set():
    content = {"name": "a", "markers": {"elbow": []}, "required": ["elbow"],
               "frames": {"back": BACK}}  # fmt: skip
    with pytest.raises(Exception, match="frames: no marker 'left_shoulder'; allowed: elbow"):
        parse_config(content, MarkerSet, "a.yaml")


# What lies on the thumb's side of a hand and what on the little finger's, by the guides of those
# who named it.
SIDES = {
    "plug_in_gait": ("RWRA", "RWRB"),
    "anatomical": ("RFAradius", "RFAulna"),
    "motive": ("RWristOut", "RWristIn"),
    "hand_knuckles": ("RHandIn", "RHandOut"),
    "opensim_gait": ("R.Wrist.Lat", "R.Wrist.Med"),
    "opencap": ("r_lwrist_study", "r_mwrist_study"),
    "spl": ("R_1STFINGER", "R_5THFINGER"),
    "bvh": ("RightHandIndex1", "RightHandPinky1"),
}


@pytest.mark.parametrize("name", SIDES)
def test_palm_down_the_thumb_of_a_right_hand_is_on_its_left(name):
    marker_set = load_marker_set(name)
    sides = dict(marker_set.frames.hand)
    thumb, little = marker_set.find(SIDES[name], "a.c3d")
    assert (sides["thumb_side"], sides["little_side"]) == ((thumb,), (little,))
    places = {
        "left_shoulder": [0, 0.2, 1.45],
        "shoulder": [0, -0.2, 1.45],
        "elbow": [0, -0.3, 1.15],
    }
    points = {one: [0.35, -0.3, 1.15] for group in sides.values() for one in group}
    for part in ("shoulder", "elbow"):
        points |= dict.fromkeys(sides[part], places[part])
    points |= dict.fromkeys(marker_set.frames.back.left, places["left_shoulder"])
    points |= {one: [0.45, -0.3, 1.15] for one in sides["fingers"]}
    points[thumb] = [points[thumb][0], -0.27, 1.15]
    points[little] = [points[little][0], -0.33, 1.15]
    positions = np.tile(np.array(list(points.values())), (20, 1, 1))
    found = marker_set.frames.derive(positions, tuple(points), np.zeros(positions.shape[:2], bool))
    axes, _ = hand_frame(*of(found, "hand_top", "hand_left", "hand_right"))
    np.testing.assert_allclose(axes[0], np.eye(3), atol=1e-9)
