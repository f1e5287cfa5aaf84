"""Recordings that labelling can use: one bad take need not end a run over many."""

from __future__ import annotations

import warnings
from dataclasses import replace

from besman.exceptions import LabellingError, RecordingWarning
from besman.person.marker_set import MarkerSet
from besman.stages.label.methods import LabelMethod
from besman.stages.read.read_inputs import Inputs


def keep_usable(
    label: LabelMethod, inputs: Inputs, markers: MarkerSet
) -> tuple[Inputs, dict[str, str]]:
    """Leave out the recordings that cannot be labelled, if the config says so.

    Parameters
    ----------
    label : LabelMethod
        Nothing is left out without its `leave_out`.
    inputs : Inputs
    markers : MarkerSet

    Returns
    -------
    Inputs
        With their segments and names.
    left_out : dict of str to str
        Why, by recording.

    Raises
    ------
    LabellingError
        If none is left: what is wrong with the first.

    Warns
    -----
    RecordingWarning
        Of each that is left out.
    """
    if not label.leave_out:
        return inputs, {}
    faults: list[LabellingError | None] = []
    with warnings.catch_warnings():
        # What labelling warns of is said when it is done.
        warnings.simplefilter("ignore", RecordingWarning)
        for recording in inputs.recordings:
            try:
                label.run((recording,), markers, inputs.teacher)
            except LabellingError as error:
                faults.append(error)
            else:
                faults.append(None)
    kept = [at for at, fault in enumerate(faults) if fault is None]
    found = [fault for fault in faults if fault is not None]
    if found and not kept:
        raise found[0]
    for fault in found:
        warnings.warn(f"left out: {fault}", RecordingWarning, stacklevel=3)
    usable = replace(
        inputs,
        recordings=tuple(inputs.recordings[at] for at in kept),
        truth=tuple(inputs.truth[at] for at in kept),
        names=tuple(inputs.names[at] for at in kept),
    )
    reasons = {
        one.source: str(fault)
        for one, fault in zip(inputs.recordings, faults, strict=True)
        if fault is not None
    }
    return usable, reasons
