"""The command ``signorini``."""

import os
import sys


def main() -> int:
    """Run the command line with the arguments of this process; returns its exit code."""
    import signal

    from ._native import program

    # As main.rs of the program does and says why.
    selected = os.environ.keys() & {"MESA_VK_DEVICE_SELECT", "NODEVICE_SELECT"}
    if not selected and not os.environ.get("XDG_RUNTIME_DIR", "").startswith("/"):
        os.environ["NODEVICE_SELECT"] = "1"

    # Ctrl-C is the program's, which writes what it has before it ends.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return program(["signorini", *map(os.fsdecode, sys.argv[1:])])
