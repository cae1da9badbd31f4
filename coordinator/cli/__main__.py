"""`python -m coordinator.cli`: the same as `flaneur`, where no script is installed."""

from coordinator.cli.main import main

main()
