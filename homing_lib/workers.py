"""What a worker process does first: it leaves Ctrl-C to its parent, and sees to it that it ends when that is gone."""

import gc
import os
import signal
import threading
import time

import psutil
from joblib.externals.loky import process_executor


def begin_work(parent: int) -> None:
    """The initializer of a pool. parent: the process that started it."""

    def end_with_parent() -> None:
        while os.getppid() == parent and psutil.pid_exists(parent):  # the first never changes on Windows
            time.sleep(2)
        os._exit(1)  # whatever it waits for: a pipe, or a lock, that nobody serves any more

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    process_executor._MAX_MEMORY_LEAK_SIZE = 2**40  # the atlases that a worker keeps are no leak, to end it for
    gc.set_threshold(100_000)  # the many numbers of an episode are no cycles to look for
    threading.Thread(target=end_with_parent, daemon=True).start()
