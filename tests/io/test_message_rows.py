"""Messages filled by arrays are, byte by byte, those that the library writes one by one."""

import numpy as np
import pytest
from ros_bags import Messages

from besman.io.message_rows import Blanks


def test_filled_messages_are_those_of_the_library():
    make = Messages()
    time_ns = np.array([0, 1_000_000_001, 2_147_483_646_999_999_999])
    places = np.random.default_rng(3).normal(size=(3, 3))
    blanks = Blanks(3)
    kind = "geometry_msgs/msg/PoseStamped"
    message = make.pose(0, [blanks.real(axis) for axis in places.T], (1, 0, 0, 0), "lab")
    message.header.stamp.sec = blanks.whole(time_ns // 10**9)
    message.header.stamp.nanosec = blanks.whole(time_ns % 10**9)
    filled = blanks.fill(lambda: bytes(make.store.serialize_cdr(message, kind)))
    for at, place, data in zip(time_ns, places, filled, strict=True):
        assert data == bytes(make.store.serialize_cdr(make.pose(at, place, frame="lab"), kind))


def test_a_blank_that_is_lost_is_told():
    blanks = Blanks(2)
    blanks.real([1.0, 2.0])
    with pytest.raises(ValueError, match="a blank stands 0 times in a message"):
        blanks.fill(lambda: b"nothing")
