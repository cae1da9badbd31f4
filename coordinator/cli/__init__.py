"""The command line: `flaneur VERB`. Only here are errors turned into exit codes.

0 all done, 1 failed, 2 wrong usage or input, 3 done but some images were skipped.
"""

from coordinator.cli.main import main

__all__ = ["main"]
