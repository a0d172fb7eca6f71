"""A rosbridge server on a loopback WebSocket with a Kinova driver behind it.

Speaks rosbridge v2 in JSON: advertise, unadvertise, publish, subscribe, unsubscribe, call_service, and the answers. The
driver is kinova-ros': velocities in degrees a second, one used every 10 ms out of a buffer of 2000, states in radians
with continuous joints within one turn, fingers in motor turns.
"""

from __future__ import annotations

import json
import threading
import time
from collections import deque

import numpy as np
from websockets.sync.server import serve

from tests.hardware.transports.stepped import Fingers

CYCLE_S, STATE_S, BUFFER_N = 0.01, 0.02, 2000
FINGER_TURNS_S = 6000.0


class KinovaDriver:
    """``kinova_driver``, stepped by a world; ``tell(topic, message)`` is how it publishes."""

    def __init__(self, q, tell, prefix="j2s7s300"):
        self.q, self.dq = np.array(q, float), np.zeros(len(q))
        self.buffer, self.stopped, self.fingers = deque(maxlen=BUFFER_N), False, Fingers(0.0, closed_sign=1)
        self.fingers.speed, self.tell, self.prefix, self.silent = FINGER_TURNS_S, tell, prefix, False
        self.heard = []
        self.continuous = np.array([True, False, True, False, True, False, True])
        self.limit_deg_s = np.array([36.0] * 4 + [48.0] * 3) * 1.05

    def on_message(self, topic, message, now_s):
        name = topic.removeprefix(f"/{self.prefix}_driver/")
        if name == "in/joint_velocity":
            self.heard.append((time.perf_counter(), now_s))
            if not self.stopped:
                self.buffer.append(np.array([message[f"joint{number}"] for number in range(1, 8)]))
        elif name == "fingers_action/finger_positions/goal":
            self.fingers.go(float(np.clip(message["goal"]["fingers"]["finger1"], 0, 6800)), FINGER_TURNS_S)
        elif name == "fingers_action/finger_positions/cancel":
            self.fingers.stop()

    def on_service(self, name):
        name = name.removeprefix(f"/{self.prefix}_driver/")
        if name == "in/stop":
            self.stopped = True
            self.buffer.clear()
            return {"stop_result": "Arm stopped"}
        if name == "in/start":
            self.stopped = False
            return {"start_result": "Arm started"}
        return None

    def cycle(self):
        """10 ms: the speed that is next in the buffer, or none."""
        wanted = self.buffer.popleft() if self.buffer else np.zeros(7)
        self.dq = np.radians(np.clip(wanted, -self.limit_deg_s, self.limit_deg_s))
        self.q = self.q + self.dq * CYCLE_S
        self.fingers.step(CYCLE_S)

    def publish(self, now_s):
        if self.silent:
            return
        stamp = {"secs": int(now_s), "nsecs": int(1e9 * (now_s % 1))}
        shown = np.where(self.continuous, self.q % (2 * np.pi), self.q)
        names = [f"{self.prefix}_joint_{n}" for n in range(1, 8)] + [
            f"{self.prefix}_joint_finger_{n}" for n in (1, 2, 3)
        ]
        finger = self.fingers.position
        self.tell(f"/{self.prefix}_driver/out/joint_state", {
            "header": {"stamp": stamp, "frame_id": "", "seq": 0}, "name": names,
            "position": [*shown.tolist(), *[finger * 1.4 / 6800] * 3],
            "velocity": [*self.dq.tolist(), 0.0, 0.0, 0.0], "effort": [1.0] * 7 + [0.0] * 3,
        })  # fmt: skip
        self.tell(
            f"/{self.prefix}_driver/out/finger_position", dict.fromkeys(("finger1", "finger2", "finger3"), finger)
        )


class RosbridgeServer:
    """Clients, topics and services. Call :meth:`step` with the time; with ``follow`` it steps itself in real time."""

    def __init__(self, q, clock):
        self.driver, self.clock = KinovaDriver(q, self.tell), clock
        self.subscribed, self.advertised, self.clients = {}, {}, []
        self.lock, self.cycles, self.states = threading.RLock(), 0, 0
        self.server = serve(self.client, "127.0.0.1", 0, compression=None)
        self.port = self.server.socket.getsockname()[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def client(self, socket):
        self.clients.append(socket)
        try:
            for text in socket:
                with self.lock:
                    self.answer(socket, json.loads(text))
        finally:
            self.clients.remove(socket)
            for sockets in self.subscribed.values():
                sockets.discard(socket)

    def answer(self, socket, message):
        op = message["op"]
        if op == "subscribe":
            self.subscribed.setdefault(message["topic"], set()).add(socket)
        elif op == "unsubscribe":
            self.subscribed.get(message["topic"], set()).discard(socket)
        elif op == "advertise":
            self.advertised[message["topic"]] = message["type"]
        elif op == "unadvertise":
            self.advertised.pop(message["topic"], None)
        elif op == "publish":
            assert message["topic"] in self.advertised, "published before it was advertised"
            self.driver.on_message(message["topic"], message["msg"], self.clock())
        elif op == "call_service":
            values = {} if message["service"] == "/sync" else self.driver.on_service(message["service"])
            reply = {"op": "service_response", "service": message["service"], "id": message.get("id")}
            self.send(
                socket,
                reply | {"values": values if values is not None else "no such service", "result": values is not None},
            )

    def tell(self, topic, message):
        for socket in tuple(self.subscribed.get(topic, ())):
            self.send(socket, {"op": "publish", "topic": topic, "msg": message})

    def send(self, socket, message):
        try:
            socket.send(json.dumps(message))
        except Exception:
            return

    def step(self):
        """Do what is due by now; whether something was published."""
        now, published = self.clock(), False
        with self.lock:
            while self.cycles * CYCLE_S <= now + 1e-9:
                self.cycles += 1
                self.driver.cycle()
            while self.states * STATE_S <= now + 1e-9:
                self.states += 1
                self.driver.publish(now)
                published = True
        return published

    def disconnect(self):
        for socket in tuple(self.clients):
            socket.close()

    def close(self):
        self.server.shutdown()
        self.disconnect()
