"""All segmentation methods beside each other: tables 4.1 to 4.4.

Run as ``python benchmarks/segmentation.py [FOLDER] [ROWS.json]``: the simulated datasets, and real
recordings with manual segments in the folder, if one is named.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rich.console import Console

from besman.evaluation.segmentation import evaluate_segmentation
from besman.evaluation.segmentation_tables import segmentation_tables
from besman.io.atomic_files import write_json


def main() -> None:
    console = Console()
    rows = evaluate_segmentation(note=console.print)["rows"]
    if len(sys.argv) > 1:
        rows += evaluate_segmentation(Path(sys.argv[1]))["rows"]
    if len(sys.argv) > 2:
        write_json(Path(sys.argv[2]), {"experiment": "segmentation", "rows": rows})
    for table in segmentation_tables(rows):
        console.print(table)


if __name__ == "__main__":
    main()
