"""The part of ArduPilot Rover's SITL, with the JSON backend, that evoros deals with.

Kept are the protocols, over real UDP and TCP, and the rules that a client can run into:

- It sends a numbered packet of servo outputs and waits for a state. Without one for a second it
  sends the packet again, with the same number. All servos are 0 until it has started.
- It finds the keys of a state by searching, between two line ends. A required key that is missing
  is told in the log, and the packet is sent again at once.
- Its time is that of the states; a step back, or of 0.1 s or more, is none.
- It reads and writes MAVLink within a frame, hence never while it waits for a state, and at most a
  hundred times a second. It keeps twenty requests for parameters, and answers five in 0.1 s.
- It arms with enough states a second for its loop rate and with data of each range finder.
- AUTO needs a route, and a position once it is armed.
- A parameter that it does not know is ignored, and not reported if it is asked for.
- SIGTERM does nothing, and it leaves files in its folder.

PEER_FAULT injects a fault (``faults.py``).
"""
