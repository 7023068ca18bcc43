"""Run a command and print its exit code, wall time [s] and most memory [kB, or bytes on macOS].

It is a program of its own, which imports next to nothing: what a process is started from counts as
its own memory.
"""

import os
import subprocess
import sys
import time


def main(command: "list[str]") -> None:
    """Run it, with nothing to read and nothing shown."""
    quiet = subprocess.DEVNULL
    begin = time.perf_counter()
    process = subprocess.Popen(command, stdin=quiet, stdout=quiet, stderr=quiet)
    if not hasattr(os, "wait4"):
        found = process.wait(), time.perf_counter() - begin, -1
    else:
        _, status, usage = os.wait4(process.pid, 0)
        found = os.waitstatus_to_exitcode(status), time.perf_counter() - begin, usage.ru_maxrss
    sys.stdout.write(" ".join(map(str, found)))


if __name__ == "__main__":
    main(sys.argv[1:])
