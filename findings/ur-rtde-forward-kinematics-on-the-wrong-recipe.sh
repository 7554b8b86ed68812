#!/bin/sh
# ur-rtde 1.6.5: getForwardKinematics(q, [0, 0, 0, 0, 0, 0]) sends twelve numbers on a recipe of six.
#
# RTDE: a client sets up input recipes (name lists), and every data package names the recipe whose
# fields its bytes are. For getForwardKinematics(q, tcp_offset) the client sends the command number
# and 12 doubles (100 bytes): on recipe 12, which has as many, where the offset has a number that is
# not zero; and on recipe 6, which has 6 doubles (52 bytes), where it is all zeros, as one writes it
# to get the flange. A controller that reads what the recipe names takes the joints and leaves the
# offset in whatever the registers held before, say the tool of the call before; one that checks the
# length drops the package or the connection.
# Expected: the package on the recipe whose length it has, whatever the numbers are.
#
# The counterpart below speaks as much of RTDE as the client asks for and prints what it gets.
# Exit status 0 while this is so, 1 when it has changed.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet ur-rtde==1.6.5
cat > "$folder/counterpart.py" <<'PYTHON'
"""As much of a controller as ur-rtde's control interface wants: RTDE, dashboard, script port."""
import socket, struct, sys, threading, time

HOST = sys.argv[1]
WIDTH = {"INT32": "i", "UINT32": "I", "DOUBLE": "d", "VECTOR6D": "6d"}
state = {"ready": 1, "runtime": 1}


def type_of(name):
    if "double" in name or name == "timestamp":
        return "DOUBLE"
    if name == "external_force_torque":
        return "VECTOR6D"
    return "INT32" if "int_register" in name else "UINT32"


def value_of(name):
    if name == "timestamp":
        return time.monotonic()
    known = {"runtime_state": state["runtime"], "robot_status_bits": 3, "safety_status_bits": 1,
             "output_int_register_0": state["ready"]}
    return known.get(name, 0)


def frame(kind, body):
    return struct.pack(">HB", len(body) + 3, kind) + body


def exactly(link, count):
    data = b""
    while len(data) < count:
        chunk = link.recv(count - len(data))
        if not chunk:
            raise OSError
        data += chunk
    return data


def stream(link, names):
    layout = ">B" + "".join(WIDTH[type_of(n)] for n in names)
    while True:
        try:
            link.sendall(frame(85, struct.pack(layout, 1, *map(value_of, names))))
        except OSError:
            return
        time.sleep(0.008)


def rtde(link):
    outputs, recipes = [], []
    while True:
        size, kind = struct.unpack(">HB", exactly(link, 3))
        body = exactly(link, size - 3)
        if kind == 86:
            link.sendall(frame(86, b"\x01"))
        elif kind == 118:
            link.sendall(frame(118, struct.pack(">4I", 5, 12, 6, 1)))
        elif kind == 79:
            outputs = [n for n in body[8:].decode().split(",") if n]
            link.sendall(frame(79, b"\x01" + ",".join(map(type_of, outputs)).encode()))
        elif kind == 73:
            names = [n for n in body.decode().split(",") if n]
            layout = ">" + "".join(WIDTH[type_of(n)] for n in names)
            recipes.append(struct.calcsize(layout))
            told = bytes([len(recipes)]) + ",".join(map(type_of, names)).encode()
            link.sendall(frame(73, told))
        elif kind == 83:
            link.sendall(frame(83, b"\x01"))
            threading.Thread(target=stream, args=(link, outputs), daemon=True).start()
        elif kind == 85:
            command = struct.unpack(">i", body[1:5])[0]
            if command == 44:
                print(f"recipe {body[0]} of {recipes[body[0] - 1]} bytes, package of"
                      f" {len(body) - 1} bytes; recipe 12 has {recipes[11]} bytes", flush=True)
            state["ready"] = 2 if command and command != 255 else 1


def dashboard(link):
    link.sendall(b"Connected: Universal Robots Dashboard Server\n")
    answers = {"polyscopeversion": "URSoftware 5.12.6.1 (Jan 01 2023)",
               "get serial number": "20195500001", "is in remote control": "true"}
    for line in link.makefile():
        link.sendall((answers.get(line.strip().lower(), "Stopped") + "\n").encode())


def script(link):
    for line in link.makefile():
        if line.rstrip() == "end":
            state["runtime"] = 2


def serve(port, handle):
    def guarded(link):
        try:
            handle(link)
        except OSError:
            pass

    server = socket.create_server((HOST, port))
    while True:
        link, _ = server.accept()
        threading.Thread(target=guarded, args=(link,), daemon=True).start()


for port, handle in ((30004, rtde), (29999, dashboard), (30003, script)):
    threading.Thread(target=serve, args=(port, handle), daemon=True).start()
time.sleep(1)
open(sys.argv[2], "w").close()
time.sleep(120)
PYTHON
"$folder/venv/bin/python" "$folder/counterpart.py" 127.77.77.77 "$folder/listens" > "$folder/heard" &
counterpart=$!
for _ in 1 2 3 4 5 6 7 8 9 10; do sleep 1; [ -e "$folder/listens" ] && break; done
timeout 60 "$folder/venv/bin/python" -c '
import os
from importlib.metadata import version
from rtde_control import RTDEControlInterface
print("ur-rtde", version("ur-rtde"), flush=True)
control = RTDEControlInterface("127.77.77.77", 125.0)
q = [0.1, -1.4, 1.6, -1.7, -1.5, 0.2]
control.getForwardKinematics(q, [0.0, 0.0, 0.15, 0.0, 0.0, 0.0])
control.getForwardKinematics(q, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
os._exit(0)
' || echo "the client ended with an error"
kill "$counterpart"
cat "$folder/heard"
grep -q "recipe 12 of 100 bytes, package of 100 bytes" "$folder/heard" \
  && grep -q "recipe 6 of 52 bytes, package of 100 bytes; recipe 12 has 100 bytes" "$folder/heard" \
  || { echo "the behaviour has changed"; exit 1; }
