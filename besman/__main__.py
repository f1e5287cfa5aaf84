"""``python -m besman`` is the command line."""

from besman.cli import main

main()
