import numpy as np
import pytest

from besman.person.build import LIMBS, find_scale, measure_limbs, measure_upright


def arm(upper_m, fore_m, n=50):
    """An arm that bends; its elbow stays."""
    angle = np.linspace(0.2, 2.0, n)
    elbow = np.zeros((n, 3))
    hand = fore_m * np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    return {"shoulder": elbow + np.array([0.0, 0.0, upper_m]), "elbow": elbow, "hand": hand}


def test_lengths_are_those_of_the_arm_with_gaps():
    points = arm(0.31, 0.35)
    points["hand"][10:20] = np.nan
    upper, fore = measure_limbs(points)
    assert (upper.length_m, fore.length_m) == pytest.approx((0.31, 0.35))
    assert [(one.is_human, one.is_steady) for one in (upper, fore)] == [(True, True)] * 2
    assert measure_limbs({"elbow": points["elbow"]}) == []
    assert measure_limbs({**points, "hand": np.full((50, 3), np.nan)}) == [upper]


@pytest.mark.parametrize("height", [1.2, 1.5, 1.7, 1.9, 2.1])
def test_everybody_has_limbs_of_human_length(height):
    limbs = measure_limbs(arm(0.186 * height, 0.2 * height))
    assert all(one.is_human for one in limbs)
    assert find_scale(limbs) is None


@pytest.mark.parametrize("height", [1.2, 1.7, 2.1])
@pytest.mark.parametrize("power", [-3, -2, -1, 1, 2, 3])
def test_a_wrong_unit_is_told_by_its_power_of_ten(height, power):
    scale = 10.0**power
    limbs = measure_limbs(arm(scale * 0.186 * height, scale * 0.2 * height))
    assert not any(one.is_human for one in limbs)
    assert find_scale(limbs) == scale


def test_what_no_unit_explains():
    assert find_scale(measure_limbs(arm(3.1, 0.035))) is None
    assert find_scale(measure_limbs(arm(0.0, 0.0))) is None
    assert find_scale(measure_limbs(arm(0.31, 3.5))) is None
    assert find_scale([]) is None
    assert find_scale(measure_limbs(arm(1.2, 1.3))) is None


def test_a_limb_that_changes_is_not_steady():
    points = arm(0.31, 0.35)
    points["shoulder"] = points["shoulder"] * np.linspace(0.3, 2.0, 50)[:, np.newaxis]
    assert not measure_limbs(points)[0].is_steady
    assert len(LIMBS) == 2


@pytest.mark.parametrize("lean", [0.0, 30.0, 90.0, 170.0])
def test_a_back_leans(lean):
    turn = np.radians(lean)
    base = np.zeros((40, 3))
    top = base + 0.13 * np.array([np.sin(turn), 0.0, np.cos(turn)])
    across = np.array([0.0, 0.06, 0.0])
    assert measure_upright(top, base + across, base - across) == pytest.approx(lean)


def test_who_is_upright_for_a_while_is_upright():
    base, across = np.zeros((100, 3)), np.array([0.0, 0.06, 0.0])
    top = base + np.array([0.13, 0.0, 0.0])
    top[:20] = [0.0, 0.0, 0.13]
    assert measure_upright(top, base + across, base - across) == pytest.approx(0.0)
    top[5:20] = [0.13, 0.0, 0.0]
    assert measure_upright(top, base + across, base - across) == pytest.approx(90.0)
    assert np.isnan(measure_upright(np.full((9, 3), np.nan), base[:9], base[:9]))
