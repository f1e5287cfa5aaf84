"""What becomes known of a stream, as a marker stream of Lab Streaming Layer.

The extra ``lsl``: ``pylsl``. Recorders of laboratories write it beside all other streams, on one
clock.
"""

from __future__ import annotations

from besman.exceptions import WebError, in_one_line, why_not_there


class LslEvents:
    """Announces a stream of type ``Markers``: one channel of text, no rate.

    Parameters
    ----------
    name : str
        Of the stream.

    Raises
    ------
    WebError
        If liblsl is not installed, or cannot announce it.
    """

    def __init__(self, name: str) -> None:
        try:
            import pylsl
        except (ImportError, RuntimeError) as error:
            reason = in_one_line(error)
            if isinstance(error, ImportError):
                reason = why_not_there(error, "pylsl", "besman[lsl]")
            raise WebError(f"--lsl: {reason}") from None
        if not name.strip():
            raise WebError("--lsl: got an empty name; expected one that recorders can look for")
        about = pylsl.StreamInfo(
            name, "Markers", 1, pylsl.IRREGULAR_RATE, "string", f"besman {name}"
        )
        about.set_channel_labels(["json"])
        try:
            self._outlet = pylsl.StreamOutlet(about)
        except RuntimeError as error:
            raise WebError(f"--lsl {name}: {in_one_line(error):.200}") from None

    def send(self, text: str) -> None:
        """Send a line; its time is now."""
        self._outlet.push_sample([text])
