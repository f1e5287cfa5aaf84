import pytest

from besman.exceptions import LabellingError
from besman.person.marker_set import load_marker_set, without_subject
from besman.person.marker_set_fit import fit_marker_sets, list_marker_sets
from besman.person.mirror import mirror_name

HEAD = "LFHD RFHD LBHD RBHD"
TRUNK = "C7 T10 CLAV STRN"
ARMS = "LSHO LUPA LELB LFRM LWRA LWRB LFIN RSHO RUPA RELB RFRM RWRA RWRB RFIN"
LEGS = "LTHI LKNE LANK LHEE LTOE RTHI RKNE RANK RHEE RTOE"
# The names that systems give, by the set that is to be found.
PUBLIC = {
    "plug_in_gait": f"{HEAD} {TRUNK} RBAK {ARMS} LASI RASI LPSI RPSI LTIB RTIB {LEGS}",
    "cmu": f"{HEAD} {TRUNK} RBAC {ARMS} LFWT RFWT LBWT RBWT LSHN LMT5 RSHN RMT5 {LEGS}",
    "halpe": "Hip RHip RKnee RAnkle RBigToe RSmallToe RHeel LHip LKnee LAnkle LBigToe LSmallToe "
    "LHeel Neck Head Nose RShoulder RElbow RWrist LShoulder LElbow LWrist",
    "coco": "nose left_eye right_eye left_ear right_ear left_shoulder right_shoulder left_elbow "
    "right_elbow left_wrist right_wrist left_hip right_hip left_knee right_knee left_ankle "
    "right_ankle",
    "opencap": "C7_study r_shoulder_study L_shoulder_study r.ASIS_study L.ASIS_study r.PSIS_study "
    "L.PSIS_study r_lelbow_study L_lelbow_study r_melbow_study L_melbow_study r_lwrist_study "
    "L_lwrist_study r_mwrist_study L_mwrist_study r_knee_study RHJC_study LHJC_study",
    "bvh": "Hips Spine Spine1 Spine2 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand "
    "LeftHandThumb1 LeftHandIndex1 LeftHandPinky1 RightShoulder RightArm RightForeArm RightHand "
    "RightHandThumb1 RightHandIndex1 RightHandPinky1 LeftUpLeg LeftLeg LeftFoot LeftToeBase",
    "theia": "worldbody head torso l_uarm l_larm l_hand r_uarm r_larm r_hand pelvis l_thigh "
    "l_shank l_foot l_toes r_thigh r_shank r_foot r_toes pelvis_shifted",
    "bvh_joints": "Hips Chest Chest2 Chest3 Chest4 Neck Head RightCollar RightShoulder RightElbow "
    "RightWrist LeftCollar LeftShoulder LeftElbow LeftWrist RightHip RightKnee RightAnkle",
}


# The same set by what other systems call its parts: of the right arm and the trunk.
OTHERS = {
    "bvh": {
        "unity": "RightShoulder RightUpperArm RightLowerArm RightHand RightLittleProximal Hips",
        "motive": "RShoulder RUArm RFArm RHand RIndex1 RPinky1 RThigh Hip Ab Chest Neck Head",
        "unreal": "clavicle_r upperarm_r lowerarm_r hand_r index_01_r thigh_r pelvis spine_01 root",
        "bandai": "Shoulder_R UpperArm_R LowerArm_R Hand_R UpperLeg_R joint_Root Hips Spine Chest",
        "biped": "Bip01_R_Clavicle Bip01_R_UpperArm Bip01_R_Forearm Bip01_R_Hand Bip01_Pelvis",
        "daz": "rCollar rShldr rForeArm rHand rThumb1 rIndex1 rThigh hip abdomen chest neck head",
        "acclaim": "rclavicle rhumerus rradius rwrist rhand rfingers rthumb rfemur root thorax",
        "arkit": "right_shoulder_1_joint right_arm_joint right_forearm_joint right_hand_joint "
        "hips_joint",
    },
    "bvh_joints": {
        "smpl": "right_collar right_shoulder right_elbow right_wrist right_hand pelvis spine1 neck",
        "smpl as bvh": "R_Collar R_Shoulder R_Elbow R_Wrist R_Hand R_Hip Pelvis Spine1 Neck Head",
    },
    "kinect": {
        "2": "ShoulderRight ElbowRight WristRight HandRight HandTipRight HipRight SpineBase",
        "azure": "CLAVICLE_RIGHT SHOULDER_RIGHT ELBOW_RIGHT WRIST_RIGHT HANDTIP_RIGHT PELVIS HEAD",
    },
    "motive": {
        "baseline": "RShoulderTop RShoulderBack RUArmHigh RElbowOut RWristOut RWristIn RHandOut "
        "HeadTop HeadFront Chest BackTop BackLeft WaistRFront WaistRBack",
    },
    "hand_knuckles": {
        "qualisys": "RShoulderTop RArm RElbowOut RElbowIn RWristOut RWristIn RHandOut RHandIn "
        "HeadTop Chest SpineTop WaistRFront WaistR",
        "kit": "RSHO RUPA RAEL RAOL RWTS RWPS RHTS RHPS C7 T10 STRN RASI RPSI",
    },
    "anatomical": {
        "opensim": "RACR RASH RPSH RLEL RMEL RFAradius RFAulna RASI RPSI C7 CLAV",
        "qualisys": "R_SAE R_HLE R_HME R_RSP R_USP R_HM2 R_HM5 R_IAS R_IPS CV7 SJN",
        "isb": "RAC RELL RELM RRS RUS RMC2 RMC5 C7 T8 IJ PX",
    },
    "opensim_gait": {
        "gait2354": "R.Acromium R.Bicep R.Elbow R.Wrist.Med R.Wrist.Lat R.ASIS Sternum V.Sacral",
    },
    "helen_hayes": {
        "cleveland": "R.Shoulder R.Elbow R.Wrist R.ASIS V.Sacral",
        "short": "RSH RELB RWR RASI RTHLP C7 SACR",
    },
}
BY_OTHERS = [(name, who) for name, sets in OTHERS.items() for who in sets]


def with_left(names):
    """Names of the right side, and of the left as well."""
    return [*names, *(other for one in names if (other := mirror_name(one)) != one)]


@pytest.mark.parametrize(("name", "who"), BY_OTHERS)
def test_parts_are_known_by_what_other_systems_call_them(name, who):
    names = with_left(OTHERS[name][who].split())
    best = fit_marker_sets(names, "a.c3d")[0]
    assert (best.marker_set.name, best.is_complete) == (name, True)
    sides = {one for one in best.found if one.startswith("left_")}
    assert {one.removeprefix("left_") for one in sides} <= set(best.found)
    assert len(sides) >= 3
    for marker in sides:
        right = best.found[marker.removeprefix("left_")]
        assert mirror_name(right) == best.found[marker], marker


@pytest.mark.parametrize("before", ["", "Ann:", "mixamorig:", "Skeleton_001_", "A:B:"])
@pytest.mark.parametrize("name", PUBLIC)
def test_public_names_find_their_set_whatever_stands_before_them(name, before):
    best = fit_marker_sets([f"{before}{one}" for one in PUBLIC[name].split()], "a.c3d")[0]
    assert best.marker_set.name == name
    assert best.is_complete
    assert best.found[best.marker_set.required[0]].startswith(before)


@pytest.mark.parametrize("name", [one for one in PUBLIC if one not in ("opencap", "theia")])
def test_what_nearly_all_names_begin_with_does_not_count(name):
    """As Motive writes TRC and C3D; an object has another name."""
    names = [f"Fred_{one}" for one in PUBLIC[name].split()]
    best = fit_marker_sets([*names, "box", None], "a.c3d")[0]
    assert (best.marker_set.name, best.is_complete) == (name, True)
    fewer = [*names[:8], *(f"thing_{at}" for at in range(9))]
    assert not any(fit.is_complete for fit in fit_marker_sets(fewer, "a.c3d"))


def test_opencap_with_its_keypoints_is_opencap():
    names = f"{PUBLIC['opencap']} {PUBLIC['halpe'].replace('Hip ', 'midHip ', 1)}".split()
    complete = [fit.marker_set.name for fit in fit_marker_sets(names, "a.trc") if fit.is_complete]
    assert complete == ["opencap", "halpe", "spl"]  # the first assumes less


@pytest.mark.parametrize(
    ("fingers", "name"),
    [("THUMB PINKY", "spl"), ("FIRST_FINGER_MCP FIFTH_FINGER_MCP", "spl_fingers")],
)
@pytest.mark.parametrize("more", ["", "THUMB PINKY FIRST_FINGER_MCP FIFTH_FINGER_MCP"])
def test_the_later_session_of_spl_tells_how_a_hand_is_turned(fingers, name, more):
    parts = f"SHOULDER ELBOW WRIST HIP KNEE ANKLE BIG_TOE HEEL EYE EAR {more or fingers}".split()
    names = [f"{side}_{part}" for side in ("LEFT", "RIGHT") for part in parts]
    best = fit_marker_sets([*names, "NOSE", "NECK", "MID_HIP", "ball"], "a.json")[0]
    assert best.is_complete
    assert best.marker_set.name == name or (more and best.marker_set.name in ("spl", "spl_fingers"))
    assert best.marker_set.frames.find_assumptions(best.found) == (
        "the markers of the back lie as on a person of 1.70 m",
    )


@pytest.mark.parametrize("name", list_marker_sets())
def test_every_set_is_found_by_its_own_names_and_is_the_same_in_the_mirror(name):
    marker_set = load_marker_set(name)
    names = list(marker_set.markers)
    assert list(marker_set.match(names, "a.c3d")) == names
    assert marker_set.hand
    mirrored = marker_set.model_copy(update={"side": "left"})
    assert list(mirrored.match([mirror_name(one) for one in names], "a.c3d")) == names


OF_POINTS = [one for one in list_marker_sets() if hasattr(load_marker_set(one).frames, "left_hand")]


@pytest.mark.parametrize("name", OF_POINTS)
def test_both_arms_of_a_set_of_points_are_alike(name):
    frames = load_marker_set(name).frames
    left, right = dict(frames.left_hand), dict(frames.hand)
    assert {key: [one.removeprefix("left_") for one in group] for key, group in left.items()} == {
        key: [one.removeprefix("right_") for one in group] for key, group in right.items()
    }


def test_a_set_that_does_not_fit_says_what_is_missing():
    best = fit_marker_sets(
        ["Shoulder", "Elbow", "Hand top", "Hand right", "Back top", "extra"], "a.tsv"
    )[0]
    assert not best.is_complete
    assert best.missing == ("back_left", "back_right", "hand_left")
    assert fit_marker_sets(["extra", None], "a.tsv") == ()


def test_two_people_are_a_fault_of_the_fit():
    names = [f"{who}:{one}" for who in ("Ann", "Bob") for one in PUBLIC["plug_in_gait"].split()]
    with pytest.raises(LabellingError, match=r"'Ann:.*' and 'Bob:.*' both stand for .*besman look"):
        load_marker_set("plug_in_gait").find(names, "a.c3d")
    fits = {fit.marker_set.name: fit for fit in fit_marker_sets(names, "a.c3d")}
    assert not fits["plug_in_gait"].is_complete
    assert "expected one" in fits["plug_in_gait"].fault
    assert "besman look" not in fits["plug_in_gait"].fault


def test_aliases_are_what_differs():
    best = fit_marker_sets(
        ["Back top", "back-left", "BackRight", "right_shoulder", "Elbow", "Hand top", "hand left",
         "hand_right"], "a.tsv")[0]  # fmt: skip
    assert best.marker_set.name == "right_arm"
    assert best.aliases == {"shoulder": "right_shoulder"}
    assert best.absent == ("thumb", "index", "middle", "box_back", "box_left", "stick")


@pytest.mark.parametrize(
    ("name", "bare"),
    [("Ann:RELB", "RELB"), ("a:b:c", "c"), ("Skeleton_001_Hip", "Hip"), ("Skeleton 001:Hip", "Hip"),
     ("RELB", "RELB"), ("Person1_LSHO", "LSHO"), ("ball", "ball")],
)  # fmt: skip
def test_names_without_their_subject(name, bare):
    assert without_subject(name) == bare


def test_a_suit_needs_its_orientations():
    names = ["T8", "RightUpperArm", "RightForeArm", "RightHand"]
    assert not any(fit.is_complete for fit in fit_marker_sets(names, "a.csv"))
    best = fit_marker_sets(names, "a.mvnx", has_orientations=True)[0]
    assert best.marker_set.name == "xsens"
    assert best.is_complete
