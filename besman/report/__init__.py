"""What a run did, in the terminal and as one self-contained page."""
