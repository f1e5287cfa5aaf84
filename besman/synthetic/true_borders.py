"""When the movements of a script begin and end, as an annotator sees it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from besman.synthetic.script import ArmScript, Movement, Pause, play_script

FloatArray = npt.NDArray[np.float64]

_VISIBLE_SHARE = 0.03
_FINE_STEP_S = 0.001


def time_phases(script: ArmScript) -> list[tuple[float, float]]:
    """Find when the phases of a script begin and end, as an annotator with no noise would.

    A movement begins and ends where it has a few percent of its speed; where two run into each
    other, the border is where the hand is slowest.

    Parameters
    ----------
    script : ArmScript

    Returns
    -------
    list of (start, end)
        Seconds, one per phase.
    """
    time = np.arange(0.0, script.end + _FINE_STEP_S, _FINE_STEP_S)
    speed = np.linalg.norm(np.gradient(play_script(script, time)[0], _FINE_STEP_S, axis=0), axis=1)
    spans: list[tuple[float, float] | None] = [
        _visible(phase, time, speed) if isinstance(phase, Movement) else None
        for phase in script.phases
    ]
    for index in range(1, len(spans)):
        one, two = spans[index - 1], spans[index]
        if one is not None and two is not None:
            border = _slowest(script.phases[index - 1], script.phases[index], time, speed)
            spans[index - 1], spans[index] = (one[0], border), (border, two[1])
    found: list[tuple[float, float]] = []
    for index, span in enumerate(spans):
        phase = script.phases[index]
        if isinstance(phase, Pause):
            ahead = spans[index + 1] if index + 1 < len(spans) else None
            span = (found[-1][1] if found else 0.0, ahead[0] if ahead else phase.end)
        assert span is not None
        found.append(span)
    return found


def time_parts(script: ArmScript, movement: Movement, span: tuple[float, float]) -> list[float]:
    """Find the borders of the parts of a movement, seconds, with its own start and end."""
    inner = []
    for one, two in zip(movement.strokes[:-1], movement.strokes[1:], strict=True):
        time = np.arange(one.bell.peak_time, two.bell.peak_time, _FINE_STEP_S)
        speed = np.linalg.norm(np.gradient(play_script(script, time)[0], axis=0), axis=1)
        inner.append(float(time[np.argmin(speed)]))
    return [span[0], *inner, span[1]]


def _visible(movement: Movement, time: FloatArray, speed: FloatArray) -> tuple[float, float]:
    """When a movement can be seen."""
    bells = [stroke.bell for stroke in movement.strokes]
    rows = slice(*np.searchsorted(time, [bells[0].start, bells[-1].end]))
    seen = np.flatnonzero(speed[rows] > _VISIBLE_SHARE * speed[rows].max())
    return float(time[rows][seen[0]]), float(time[rows][seen[-1]])


def _slowest(
    one: Movement | Pause, two: Movement | Pause, time: FloatArray, speed: FloatArray
) -> float:
    """When the hand is slowest between two movements; the middle of a short rest."""
    assert isinstance(one, Movement)
    assert isinstance(two, Movement)
    ends = [one.strokes[-1].bell.peak_time, two.strokes[0].bell.peak_time]
    rows = slice(*np.searchsorted(time, ends))
    quiet = time[rows][speed[rows] <= speed[rows].min() + 1e-6]
    return float(quiet.mean())
