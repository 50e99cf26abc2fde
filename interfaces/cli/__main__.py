"""`python -m interfaces.cli` is the `vrs` command."""

from interfaces.cli.main import main

main()
