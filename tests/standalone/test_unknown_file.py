import pytest

from besman.exceptions import RecordingError
from besman.standalone.look_files import look_at
from besman.standalone.unknown_file import describe_unknown, is_like_recording


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("a.xlsx", b"PK\x03\x04rest", "an archive (.xlsx, .zip): save its tables as CSV"),
        ("a.gz", b"\x1f\x8b\x08", "compressed by gzip"),
        ("a.mat", b"MATLAB 5.0 MAT-file", "a MATLAB file: export C3D or CSV"),
        ("a.h5", b"\x89HDF\r\n", "HDF5"),
        ("a.npy", b"\x93NUMPY\x01", "a NumPy array"),
        ("a.fbx", b"Kaydara FBX Binary", "FBX: export BVH"),
        ("a.mp4", b"\0\0\0 ftypisom", "a picture or a video"),
        ("a.db3", b"SQLite format 3\0", "a database of SQLite, without the tables of a bag"),
        ("a.json", b'[{"start index": 6, "end index": 9}]', "segments of a recording: look at"),
        ("a.json", b'{\n "segments": []}', "it looks like segments of a recording"),
        ("a.urdf", b'<?xml version="1.0"?>\n<!-- a -->\n<robot name="a">', "a robot (URDF, xacro"),
        ("a.xml", b'<mujoco model="a">', "besman robots try FILE"),
        ("a.yaml", b"# mine\nname: a\nrecordings: b\n", "a pipeline: besman check FILE"),
        ("a.json", b'{"version":1.3,"people":[{"pose_keypoints_2d":[1,2]}]}', "points in"),
        ("a.json", b'{"images":[],\n"annotations":[{"image_id":1}]}', "not in space"),
        ("a.json", b'{\n "info": {},\n "licenses": [],\n "images": []}', "points in a picture (Op"),
        ("a.json", b'[{"image_id":1,"keypoints":[1,2,2]}]', "points in a picture (OpenPose, COCO)"),
        ("a.mot", b"Coordinates\nversion=1\nendheader\ntime\ta\n", "give the TRC they are from"),
        ("a.amc", b"#!OML:ASF\n:FULLY-SPECIFIED\n:DEGREES\n1\n", "Acclaim's motion (AMC)"),
        ("a.pkl", b"\x80\x04\x95", "a pickle of Python: write CSV with columns NAME_x"),
        ("a.npz", b"PK\x03\x04rest", "by its ending it is arrays of NumPy: write CSV with columns"),
        ("a.tak", b"\0\1\2", "by its ending it is a take of Motive: export CSV or C3D there"),
        ("a.X2D", b"\0\1\2", "by its ending it is camera data of Vicon"),
        ("a.txt", b"the endheader of a\n", "it is text, begins with 'the endheader of a'"),
        ("a.txt", b"# name: a\n", "it is text, begins with '# name: a'"),
        ("a.bin", b"\x01\x02\0\x04", "it is binary, begins with 01 02 00 04"),
        ("a.c3d", b"\0\0\0\0", "binary, begins with 00 00 00 00, and is not C3D as its ending"),
        ("a.txt", b"hello\n1,2,3\n4,5,6\n", "it is text, 3 columns between commas, begins with"),
        ("a.trc", b"1\t2\n", "2 columns between tabs, begins with '1\\t2', and is not TRC as"),
        ("a.txt", b"hello world", "it is text, begins with 'hello world'; a table is read whose"),
    ],
)
def test_what_a_file_looks_like(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_bytes(content)
    assert said in describe_unknown(path)


@pytest.mark.parametrize(
    "content",
    [
        '{"info": {"year": 2020}, "licenses": [{"id": 1}], "images": [{"id": 1}], "annotations": '
        '[{"id": 1, "image_id": 1, "keypoints": [1, 2, 2, 3, 4, 2]}], "categories": [{"keypoints": '
        '["nose", "left_shoulder", "left_wrist"]}]}',
        '[{"image_id": 1, "keypoints": [300.0, 105.0, 2, 335.2, 347.2, 1, 1.5, 2.5, 1]}]',
    ],
)
def test_points_in_pictures_are_not_taken_for_a_recording(tmp_path, content):
    path = tmp_path / "a.json"
    path.write_text(content)
    with pytest.raises(RecordingError, match=r"points in a picture \(OpenPose, COCO\), not in sp"):
        look_at(path)


@pytest.mark.parametrize(
    ("name", "content", "is_like"),
    [
        ("a.mot", b"Coordinates\nversion=1\nendheader\ntime\ta\n", True),
        ("coco.json", b'{"images":[],\n"annotations":[{"image_id":1}]}', True),
        ("a.tak", b"text", True),
        ("a.dat", b"\1\2\0", True),
        ("forces.txt", b"%\n0 1 2\n1 1 2\n2 1 2\n", True),
        ("a.json", b'{"data": [1, 2.5, -3e1, 4, 5, 6, 7]}', True),
        ("README.md", b"1 2\n1 2\n1 2\n", False),
        ("LICENSE", b"a 1\n1 2\n", False),
        ("package.json", b'{"name": "left_shoulder", "sizes": [1, 2]}', False),
        ("a_manually_segmented.json", b"[1, 2, 3, 4, 5, 6, 7]", False),
        ("robot.xml", b'<mujoco model="a">', False),
        ("a", b"\x89PNG\r\n\0", False),
        ("a.py", b"\1\0", False),
        ("a.txt", b"", False),
    ],
)
def test_what_lies_beside_recordings_is_told_from_what_may_be_one(tmp_path, name, content, is_like):
    path = tmp_path / name
    path.write_bytes(content)
    assert is_like_recording(path) is is_like
