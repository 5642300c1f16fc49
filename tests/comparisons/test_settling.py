"""Nothing is measured beside what is still at work."""

import hashlib
import threading

from comparisons.settling import settle


def test_waits_for_a_busy_thread():
    # Hashing lets go of Python's lock: some tenths of a second, on a core of its own.
    done = threading.Event()

    def work():
        hashlib.sha256(bytes(1 << 27)).digest()
        done.set()

    worker = threading.Thread(target=work)
    worker.start()
    settle(longest=60.0)
    assert done.is_set()
    worker.join()


def test_does_not_wait_for_ever():
    stop = threading.Event()

    def work():
        while not stop.is_set():
            pass

    worker = threading.Thread(target=work)
    worker.start()
    settle(longest=0.05)
    assert worker.is_alive()
    stop.set()
    worker.join()
