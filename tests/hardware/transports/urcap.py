"""Robotiq's URCap: one line in, one line out, counts instead of metres; and OnRobot's, XML-RPC and millimetres."""

from __future__ import annotations

import socketserver
import threading
from contextlib import suppress
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

from tests.hardware.transports.stepped import Fingers

SPEED_MPS = (0.020, 0.150)
STROKE_M, OPEN, CLOSED = 0.085, 3, 230


class Robotiq:
    """A 2F-85; ``blocked_at`` in counts."""

    def __init__(self, world):
        self.fingers = Fingers(OPEN, closed_sign=1)
        self.requested, self.speed, self.force, self.going, self.status, self.fault = OPEN, 255, 0, 0, 3, 0
        self.emergency, self.said = False, []
        world.on_tick(self.step)
        gripper = self

        class Handler(socketserver.StreamRequestHandler):
            disable_nagle_algorithm = True

            def handle(self):
                gripper.connections.append(self.connection)
                for line in self.rfile:
                    self.wfile.write((gripper.answer(line.decode().strip()) + "\n").encode())

        self.connections = []
        self.server = socketserver.ThreadingTCPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()

    def step(self, dt):
        if self.going and not self.emergency:
            self.fingers.step(dt)

    def answer(self, line):
        self.said.append(line)
        verb, *words = line.split()
        if verb == "GET" and len(words) == 1:
            return f"{words[0]} {self.read(words[0])}"
        if verb == "SET" and words and len(words) % 2 == 0:
            values = dict(zip(words[::2], map(int, words[1::2]), strict=True))
            if all(0 <= value <= 255 for value in values.values()):
                self.write(values)
                return "ack"
        return "?"

    def write(self, values):
        self.requested = values.get("POS", self.requested)
        self.speed, self.force = values.get("SPE", self.speed), values.get("FOR", self.force)
        self.going = values.get("GTO", self.going)
        low, high = SPEED_MPS
        counts_s = (low + self.speed / 255 * (high - low)) / STROKE_M * (CLOSED - OPEN)
        if self.going:
            self.fingers.go(min(max(self.requested, OPEN), CLOSED), counts_s)
        else:
            self.fingers.stop()

    def read(self, name):
        if self.emergency:
            return "?"
        fingers = self.fingers
        objects = 0 if fingers.moving and self.going else 2 if fingers.holding else 3
        return {
            "POS": round(fingers.position), "OBJ": objects, "PRE": self.requested, "STA": self.status,
            "FLT": self.fault, "SPE": self.speed, "FOR": self.force, "ACT": 1, "GTO": self.going,
        }.get(name, "?")  # fmt: skip

    def disconnect(self):
        for connection in self.connections:
            with suppress(OSError):
                connection.shutdown(2)

    def close(self):
        self.disconnect()
        self.server.shutdown()
        self.server.server_close()


class _Quick(SimpleXMLRPCRequestHandler):
    rpc_paths = ("/",)
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True
    wbufsize = -1


class Rg2:
    """An RG2: about 110 mm/s, whatever one asks for; ``blocked_at`` in millimetres."""

    def __init__(self, world):
        self.fingers, self.safety, self.forces = Fingers(110.0, closed_sign=-1), False, []
        world.on_tick(self.fingers.step)
        self.server = SimpleXMLRPCServer(("127.0.0.1", 0), _Quick, logRequests=False, allow_none=True)
        self.port = self.server.server_address[1]
        for call in (
            self.rg_grip, self.rg_stop, self.rg_get_width, self.rg_get_busy, self.rg_get_grip_detected,
            self.rg_get_safety_failed,
        ):  # fmt: skip
            self.server.register_function(call)
        threading.Thread(target=self.server.serve_forever, args=(0.01,), daemon=True).start()

    def rg_grip(self, tool, width_mm, force_n):
        if not (0 <= width_mm <= 110.0001 and 3 <= force_n <= 40):
            raise ValueError("out of range")
        self.forces.append(force_n)
        self.fingers.go(width_mm, 110.0)
        return 0

    def rg_stop(self, tool):
        self.fingers.stop()
        return 0

    def rg_get_width(self, tool):
        return self.fingers.position

    def rg_get_busy(self, tool):
        return self.fingers.moving

    def rg_get_grip_detected(self, tool):
        return self.fingers.holding

    def rg_get_safety_failed(self, tool):
        return self.safety

    def close(self):
        self.server.shutdown()
        self.server.server_close()
