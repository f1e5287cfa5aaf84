"""``python -m besman`` is the command line."""

from besman.cli.main import main

main()
