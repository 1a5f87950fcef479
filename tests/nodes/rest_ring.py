"""Watches processes that hand a byte on, each by its two threads, and prints what rest saw.

rest_ring.py ring|spin|stop (isolated|shared) FOLDER_OF_REST
"""

import os
import queue
import random
import signal
import subprocess
import sys
import threading
import time

STATIONS, ROUNDS = 3, 150


def station(source: int, sink: int) -> None:
    """Work a while in one thread, then in another, and start a short process now and then."""
    work = random.Random(source)
    arrived: queue.Queue[bytes] = queue.Queue()

    def send() -> None:
        while byte := arrived.get():
            sum(range(work.randrange(20_000)))
            if work.random() < 0.05:
                subprocess.run(["true"], check=True)
            os.write(sink, byte)

    threading.Thread(target=send, daemon=True).start()
    while byte := os.read(source, 1):
        sum(range(work.randrange(20_000)))
        arrived.put(byte)


def start(kind: str, *ends: int) -> "subprocess.Popen[bytes]":
    command = [sys.executable, __file__, kind, *map(str, ends)]
    return subprocess.Popen(command, pass_fds=ends)


def main() -> None:
    kind, where, folder = sys.argv[1:]
    sys.path.insert(0, folder)
    from rest import Rest  # type: ignore[import-not-found, unused-ignore]

    rest = Rest(where == "isolated")
    pipes = [os.pipe() for _ in range(STATIONS + 1)]
    started = [start("station", pipes[i][0], pipes[i + 1][1]) for i in range(STATIONS)]
    if kind == "spin":
        started.append(start("spinner"))
    rest.prepare()
    if kind != "ring":
        time.sleep(1.0)
        if kind == "stop":
            started[0].send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, started[0].pid, os.WSTOPPED)
        print(rest.wait(0.2), *rest.working(), sep="\n")
    else:
        time.sleep(0.5)
        print(rest.wait(10.0))
        source, sink = pipes[-1][0], pipes[0][1]
        os.set_blocking(source, False)
        early = 0
        for _ in range(ROUNDS):
            os.write(sink, b".")
            rest.wait(10.0)
            try:
                os.read(source, 1)
            except BlockingIOError:
                early += 1
                time.sleep(0.2)
                os.read(source, 1)
        print(early)
    for process in started:
        process.kill()


if sys.argv[1] == "station":
    station(*map(int, sys.argv[2:]))
elif sys.argv[1] == "spinner":
    while True:
        pass
else:
    main()
