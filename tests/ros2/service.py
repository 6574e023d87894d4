"""Answers Autoware's requests for a control mode as a node on rmw_cyclonedds does: python3 service.py DOMAIN cyclone

Each request and reply has in front the second half of the client's identity and a number, by which replies are told
apart. Takes the modes 1 (autonomous) and 4 (manual). Prints `ready`, and ends when standard input is closed.
"""

import sys
import threading

from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct, types
from cyclonedds.idl.annotations import final
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

HEADER = {"client": types.uint64, "number_high": types.int32, "number_low": types.uint32}
QOS = Qos(
    Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.Volatile, Policy.History.KeepLast(10)
)


def struct(half, fields):
    name = f"ControlModeCommand_{half}_"
    return final(make_idl_struct(name, f"autoware_vehicle_msgs.srv.dds_.{name}", HEADER | fields))


Request = struct("Request", {"sec": types.int32, "nanosec": types.uint32, "mode": types.uint8})
Response = struct("Response", {"success": bool})


def main():
    participant = DomainParticipant(int(sys.argv[1]))
    name = "/control/control_mode_request"
    requests = DataReader(participant, Topic(participant, f"rq{name}Request", Request, qos=QOS), qos=QOS)
    replies = DataWriter(participant, Topic(participant, f"rr{name}Reply", Response, qos=QOS), qos=QOS)
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    print("ready", flush=True)
    while not closed.is_set():
        for request in requests.take_iter(timeout=duration(milliseconds=100)):
            success = request.mode in (1, 4)
            replies.write(Response(request.client, request.number_high, request.number_low, success))


main()
