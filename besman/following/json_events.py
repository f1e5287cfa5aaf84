"""What changed and what is foreseen, as plain data for JSON."""

from __future__ import annotations

from typing import Any

from besman.following.foreseeing import BlockForecast
from besman.following.pieces import Piece


def content_of_piece(piece: Piece, rate_hz: float, first_frame: int = 1) -> dict[str, Any]:
    """Return a block or an action; its borders in seconds and in frames.

    Parameters
    ----------
    piece : Piece
    rate_hz : float
        Samples per second.
    first_frame : int
        Number of the frame of row 0.
    """
    return {
        "kind": piece.kind,
        "of": piece.of,
        "label": piece.label,
        "uncertainty": piece.uncertainty,
        "final": piece.final,
        "start_s": piece.start / rate_hz,
        "end_s": piece.end / rate_hz,
        "frames": [first_frame + piece.start, first_frame + piece.end],
    }


def content_of_forecast(forecast: BlockForecast, rate_hz: float) -> dict[str, Any]:
    """Return what goes on and what comes next."""
    next_row = forecast.next_row
    return {
        "time_s": forecast.row / rate_hz,
        "of": forecast.of,
        "start_s": forecast.start / rate_hz,
        "label": forecast.label,
        "probability": forecast.probability,
        "next_label": forecast.next_label,
        "next_probability": forecast.next_probability,
        "next_start_s": None if next_row is None else next_row / rate_hz,
    }
