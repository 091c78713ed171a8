"""The command ``signorini``."""

import os
import sys


def main() -> int:
    """Run the command line with the arguments of this process; returns its exit code."""
    import signal

    from ._native import program

    # As in main.rs of the program, which gives the reason.
    selected = os.environ.keys() & {"MESA_VK_DEVICE_SELECT", "NODEVICE_SELECT"}
    if not selected and not os.environ.get("XDG_RUNTIME_DIR", "").startswith("/"):
        os.environ["NODEVICE_SELECT"] = "1"

    # The program handles Ctrl-C: it writes its results so far before it ends.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return program(["signorini", *map(os.fsdecode, sys.argv[1:])])
