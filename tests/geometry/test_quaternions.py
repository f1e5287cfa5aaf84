import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from besman.geometry.quaternions import (
    conjugate,
    from_rotation_vector,
    make_continuous,
    multiply,
    rotation_vector,
)


def random_quaternions(seed, count=5):
    quaternions = np.random.default_rng(seed).normal(size=(count, 4))
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)


@given(st.integers(0, 10_000))
def test_product_and_inverse_are_scipys(seed):
    first, second = random_quaternions(seed), random_quaternions(seed + 1)
    one, other = (Rotation.from_quat(q, scalar_first=True) for q in (first, second))
    product = Rotation.from_quat(multiply(first, second), scalar_first=True)
    assert (product * (one * other).inv()).magnitude().max() < 1e-12
    np.testing.assert_allclose(
        multiply(first, conjugate(first)), np.tile([1, 0, 0, 0], (5, 1)), atol=1e-14
    )


@given(st.integers(0, 10_000))
def test_rotation_vector_is_scipys_the_short_way_and_the_other_way_round_with_the_sign(seed):
    quaternions = random_quaternions(seed)
    short = quaternions * np.where(quaternions[:, :1] < 0, -1, 1)
    expected = Rotation.from_quat(short, scalar_first=True).as_rotvec()
    np.testing.assert_allclose(rotation_vector(short), expected, atol=1e-12)
    np.testing.assert_allclose(from_rotation_vector(expected), short, atol=1e-12)
    other = rotation_vector(-short)
    lengths = np.linalg.norm(expected, axis=1) + np.linalg.norm(other, axis=1)
    np.testing.assert_allclose(lengths, 2 * np.pi, atol=1e-9)
    np.testing.assert_allclose(from_rotation_vector(other), -short, atol=1e-12)


def test_small_rotations_keep_their_digits():
    vectors = np.array([[0.0, 0, 0], [1e-300, 0, 0], [0, 1e-12, 0], [0, 0, 1e-7]])
    np.testing.assert_allclose(rotation_vector(from_rotation_vector(vectors)), vectors, rtol=1e-12)


def test_a_sequence_without_jumps_of_sign():
    vectors = np.outer(np.linspace(0, 6, 50), [0.6, 0.8, 0])
    smooth = from_rotation_vector(vectors)
    signs = np.where(np.random.default_rng(0).random(50) < 0.5, -1.0, 1.0)
    signs[0] = 1
    np.testing.assert_array_equal(make_continuous(smooth * signs[:, None]), smooth)
