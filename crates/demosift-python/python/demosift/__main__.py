"""``python -m demosift`` is the command."""

from .command import main

main()
