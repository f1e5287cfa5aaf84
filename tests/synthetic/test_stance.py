import numpy as np

from besman.synthetic.stance import draw_stance, stream


def test_a_key_has_random_numbers_of_its_own():
    draws = {key: stream(3, *key).random(4).tolist() for key in [(), (0,), (1,), (0, 1), (1, 0)]}
    assert len({tuple(draw) for draw in draws.values()}) == len(draws)
    assert stream(3, 0, 1).random(4).tolist() == draws[0, 1]
    assert stream(4, 0, 1).random(4).tolist() != draws[0, 1]


def test_a_body_sways_by_its_two_waves():
    stance = draw_stance(np.random.default_rng(0))
    time = np.array([0.0, 1.3, 7.0])
    for row, t in enumerate(time):
        expected = sum(
            stance.sway_m[k] * np.sin(2 * np.pi * stance.sway_hz[k] * t + stance.sway_phase[k])
            for k in range(2)
        )
        np.testing.assert_allclose(stance.sway(time)[row], expected)


def test_people_stand_on_the_floor_in_the_middle_and_face_forward():
    for seed in range(20):
        stance = draw_stance(np.random.default_rng(seed))
        assert stance.place[2] == 0
        assert np.abs(stance.place[:2]).max() <= 0.6
        assert stance.heading.apply([1.0, 0, 0])[0] > np.cos(np.radians(30.1))
