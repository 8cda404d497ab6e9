"""What the server of forks imports first: from then on it ends with the process that started it.

By itself it looks for that only when it has imported all that jobs need, seconds later.
"""

import ctypes
import signal
import sys

_PR_SET_PDEATHSIG = 1  # <linux/prctl.h>

if any("multiprocessing.forkserver" in argument for argument in sys.orig_argv):
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL), 0, 0, 0)
