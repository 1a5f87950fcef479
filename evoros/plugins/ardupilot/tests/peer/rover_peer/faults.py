"""The fault that PEER_FAULT names: ``KIND@FRAME`` or ``KIND@FRAME:VALUE``.

FRAME counts packets of servos from 0, or, as ``auto+N``, from the first one in AUTO.

==========  ==================================================================================
die         it exits with status 1
crash       it dies by a segmentation fault
hang        it neither sends nor reads any more
stop        it is stopped by SIGSTOP
miss        the packet is not sent, until for want of a state it is sent again
slow        it sleeps for VALUE seconds in every frame from there
rubbish     the packet has another magic number
short       the packet has half its length
steering    the first servo is at VALUE
throttle    the third servo is at VALUE
noise       it sends bytes over MAVLink that are no message
unlink      it closes MAVLink
deaf        it never becomes ready
==========  ==================================================================================
"""

import os
import signal
import sys
import time
from dataclasses import dataclass

FOREVER_S = 3600.0


@dataclass
class Fault:
    """One fault, and the frame at which it happens."""

    kind: str = "none"
    frame: int = 0
    from_auto: bool = False
    value: float = 0.0

    def happens(self, frame: int, in_auto: int) -> bool:
        """Whether this is its frame; ``in_auto`` is -1 before the first frame in AUTO."""
        return (in_auto if self.from_auto else frame) == self.frame

    def has_begun(self, frame: int, in_auto: int) -> bool:
        """Whether this is its frame or a later one."""
        return (in_auto if self.from_auto else frame) >= self.frame

    def act(self) -> None:
        """Do what concerns the whole process."""
        if self.kind == "die":
            sys.exit("Floating point exception - aborting (of the test)")
        if self.kind == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        if self.kind == "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
        if self.kind == "hang":
            time.sleep(FOREVER_S)


def read_fault() -> Fault:
    """Read the fault from the environment."""
    text = os.environ.get("PEER_FAULT", "")
    if not text:
        return Fault()
    kind, _, rest = text.partition("@")
    frame, _, value = rest.partition(":")
    from_auto = frame.startswith("auto+")
    return Fault(kind, int(frame.removeprefix("auto+") or 0), from_auto, float(value or 0.0))
