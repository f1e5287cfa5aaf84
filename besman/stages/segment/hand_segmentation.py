"""What all segmentation methods share: they look at hands, and are measured alike."""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Any

from pydantic import Field

from besman.config.stage import Items, Stage, Truth, Work
from besman.records import LabelledRecording, Segments
from besman.stages.segment.figures import segment_results


class SegmentingStage(Stage):
    """A segmentation method.

    Attributes
    ----------
    method : str
    markers : tuple of str
        Markers of the hand (or hands) whose movement is looked at.
    """

    method: str
    markers: Annotated[tuple[str, ...], Field(min_length=1)] = ("hand_top",)

    @abstractmethod
    def run(
        self, recordings: tuple[LabelledRecording, ...], work: Work = Work()
    ) -> tuple[Segments, ...]:
        """Segment recordings.

        Parameters
        ----------
        recordings : tuple of LabelledRecording
            What to segment.
        work : Work
            How to run.

        Returns
        -------
        tuple of Segments
            One each, with bounds at the recording's own rate; together they cover the recording.

        Raises
        ------
        SegmentationError
            If a marker was not seen throughout or a recording is too short.
        """

    def items(self, recordings: tuple[LabelledRecording, ...]) -> Items:
        """Count the recordings."""
        return Items(len(recordings), "recordings")

    def figures(
        self,
        segments: tuple[Segments, ...],
        truth: Truth,
        recordings: tuple[LabelledRecording, ...],
    ) -> dict[str, Any]:
        """Return how many segments there are, and how well they fit; see `segment_results`."""
        return segment_results(segments, truth.blocks, self.markers[0], truth.margin_s)
