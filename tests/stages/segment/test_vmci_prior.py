import numpy as np
import pytest

from besman.exceptions import SegmentationError
from besman.stages.segment.signals import prepare_signals
from besman.stages.segment.vmci import VmciModel, find_change_points
from besman.stages.segment.vmci_plain import find_change_points_plainly


def make_signals(seed, n=40):
    rng = np.random.default_rng(seed)
    return prepare_signals(np.cumsum(rng.normal(size=(n, 1, 3)), axis=0))


@pytest.mark.parametrize("scale", [0.1, 25.0])
@pytest.mark.parametrize("nu", [None, 4.0, 8.0])
def test_the_compiled_recursion_knows_the_prior_of_the_noise(scale, nu):
    data = make_signals(1)
    model = VmciModel(noise_scale=scale, degrees_of_freedom=nu)
    fast = find_change_points(data.positions, data.speeds, 0.05, None, model)
    plain = find_change_points_plainly(data.positions, data.speeds, 0.05, None, model)
    np.testing.assert_array_equal(fast.borders, plain.borders)
    assert fast.log_probability == pytest.approx(plain.log_probability, abs=1e-8)


def test_the_noise_scale_is_a_unit():
    """Data in another unit with S and D in that unit: the same borders."""
    data = make_signals(2)
    unit = VmciModel()
    scaled = VmciModel(noise_scale=9.0, weight_variance=100.0 / 9.0)
    one = find_change_points(data.positions, data.speeds, 0.05, None, unit)
    other = find_change_points(3 * data.positions, 3 * data.speeds, 0.05, None, scaled)
    np.testing.assert_array_equal(one.borders, other.borders)
    density = 40 * 4 * np.log(3)
    assert other.log_probability == pytest.approx(one.log_probability - density, abs=1e-6)


def test_bad_priors_are_refused():
    data = make_signals(3)
    with pytest.raises(SegmentationError, match=r"degrees_of_freedom: got 2\.0; must be greater"):
        find_change_points(
            data.positions, data.speeds, 0.05, None, VmciModel(degrees_of_freedom=2.0)
        )
    with pytest.raises(SegmentationError, match=r"noise_scale: got 0\.0; must be positive"):
        find_change_points(data.positions, data.speeds, 0.05, None, VmciModel(noise_scale=0.0))
