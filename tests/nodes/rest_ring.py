"""Watches processes that hand a byte on in a ring, each by two threads; prints what rest saw.

rest_ring.py ring|spin|stop|hide (isolated|shared) FOLDER_OF_REST
"""

import ctypes
import os
import queue
import random
import signal
import subprocess
import sys
import threading
import time

STATIONS, HOPS, ROUNDS, LIMIT_S = 3, 30, 50, 60.0


def station(source: int, sink: int, goal: int) -> None:
    """Work a while in one thread, then in another; the byte counts the hops that remain."""
    work = random.Random(source)
    arrived: queue.Queue[bytes] = queue.Queue()

    def send() -> None:
        while byte := arrived.get():
            sum(range(work.randrange(2_000)))
            if work.random() < 0.2:
                time.sleep(0)  # as publishers of rospy do, to let others run
            if work.random() < 0.002:
                subprocess.run(["true"], check=True)
            os.write(sink if byte[0] else goal, bytes([max(0, byte[0] - 1)]))

    signal.signal(signal.SIGUSR1, hide)
    threading.Thread(target=send, daemon=True).start()
    threading.Thread(target=time.sleep, args=(3600.0,), daemon=True).start()  # as rospy.spin does
    while byte := os.read(source, 1):
        sum(range(work.randrange(2_000)))
        arrived.put(byte)


def hide(*_: object) -> None:
    """Let no process see this one that has not all capabilities."""
    ctypes.CDLL(None).prctl(4, 0, 0, 0, 0)  # PR_SET_DUMPABLE


def start(kind: str, *ends: int) -> "subprocess.Popen[bytes]":
    command = [sys.executable, __file__, kind, *map(str, ends)]
    return subprocess.Popen(command, pass_fds=ends)


def main() -> None:
    kind, where, folder = sys.argv[1:]
    sys.path.insert(0, folder)
    from bridge.rest import Hidden, Rest  # type: ignore[import-not-found, unused-ignore]

    rest = Rest(where == "isolated")
    pipes = [os.pipe() for _ in range(STATIONS)]
    source, goal = os.pipe()
    started = [start("station", pipes[i - 1][0], pipes[i][1], goal) for i in range(STATIONS)]
    rest.prepare()
    print(rest.wait(LIMIT_S))  # they have started
    if kind != "ring":
        if kind == "spin":
            started.append(start("spinner"))
        if kind == "stop":
            started[0].send_signal(signal.SIGSTOP)
            os.waitid(os.P_PID, started[0].pid, os.WSTOPPED)
        if kind == "hide":
            started[0].send_signal(signal.SIGUSR1)
        try:
            while rest.wait(0.2):  # until the signal is handled
                time.sleep(0.01)
            print(*rest.working(), sep="\n")
        except Hidden as error:
            print(error)
    else:
        os.set_blocking(source, False)
        early = 0
        for _ in range(ROUNDS):
            os.write(pipes[0][1], bytes([HOPS]))
            rest.wait(LIMIT_S)
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
