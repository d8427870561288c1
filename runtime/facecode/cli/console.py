"""What every command line of facecode shares: exit codes and one clear line for what went wrong.

0 done; 2 the caller's mistake; 1 a defect; 130 interrupted; 143 terminated.
"""

from __future__ import annotations

import io
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable

from facecode.errors import FacecodeError

DONE, DEFECT, MISTAKE, INTERRUPTED, TERMINATED = 0, 1, 2, 130, 143


def guarded(program: str, command: Callable[[], int | None], debug: bool) -> int:
    """Run `command` and turn exceptions into an exit code and a line on stderr."""
    for stream in (sys.stdout, sys.stderr):  # a name that a console cannot show is no failure
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    # As after Ctrl-C, the blocks that remove temporary files must run.
    previous = signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))
    try:
        with warnings.catch_warnings():
            if not debug:
                warnings.showwarning = lambda message, *_, **__: print(
                    f"{program}: warning: {message}", file=sys.stderr
                )
            return command() or DONE
    except BrokenPipeError:
        # The reader of stdout went away; what is still buffered must not fail at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return MISTAKE
    except (Exception, KeyboardInterrupt) as error:
        if debug:
            traceback.print_exc()
        code, line = _verdict(error)
        print(f"{program}: {line}", file=sys.stderr)
        return code
    finally:
        signal.signal(signal.SIGTERM, previous)


def _verdict(error: BaseException) -> tuple[int, str]:
    if isinstance(error, FacecodeError):
        return error.exit_code, str(error)
    if isinstance(error, KeyboardInterrupt):
        return INTERRUPTED, "interrupted; nothing was left half-written"
    return DEFECT, f"defect: {type(error).__name__}: {error} (--debug shows where)"
