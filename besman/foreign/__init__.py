"""What others wrote, read with limits: JSON, YAML, URDF, numbers and names in text.

Nothing here knows what the content means; everything ends in a `ValueError` that says what is
wrong, never in an error of a library, in endless work or in more memory than the text is long.
"""
