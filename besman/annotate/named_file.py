"""A recording written with the names given on the page, beside the one that was read."""

from __future__ import annotations

from pathlib import Path

from besman.exceptions import AnnotationError
from besman.io.recordings.formats import WRITTEN_SUFFIXES, write_recording
from besman.stages.label.joined_trajectories import WovenRecording


class NamedFile:
    """``STEM_named.tsv``; no file that was there before is overwritten.

    Parameters
    ----------
    source : Path
        The recording that was read; written in its format, if that can be, or as TSV.

    Attributes
    ----------
    path : Path
        ``STEM_named_2`` and so on, where the first is taken.
    """

    def __init__(self, source: Path) -> None:
        ending = source.suffix.lower() if source.suffix.lower() in WRITTEN_SUFFIXES else ".tsv"
        number = 1
        while True:
            more = "" if number == 1 else f"_{number}"
            self.path = source.with_name(f"{source.stem}_named{more}{ending}")
            if not self.path.exists():
                break
            number += 1
        self._own = False

    def write(self, recording: WovenRecording) -> Path:
        """Write the recording, whole or not at all.

        Raises
        ------
        BesmanError
            If it cannot be written, or another wrote such a file in the meantime.
        """
        if self.path.exists() and not self._own:
            raise AnnotationError(
                f"{self.path}: was written by another in the meantime and is not overwritten; "
                "start besman annotate again for another name"
            )
        # What is named is put together as it is written.
        write_recording(recording.frames, self.path, recording)
        self._own = True
        return self.path
