"""Reads what a simulated car says on ROS 2's topics: python3 watch.py DOMAIN SECONDS

Topics are named on standard input, one `TOPIC PACKAGE/NAME` a line, until an empty line. Prints `ready`, reads until
so many seconds have passed since the first message or standard input is closed, and prints one JSON object: by topic
how many messages came, when by this host's clock, and the first and the last of them with long sequences cut to
their length and their first elements.
"""

import dataclasses
import json
import math
import sys
import threading
import time

from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from ros_types import ros

HEAD = 64


def plain(value):
    if dataclasses.is_dataclass(value):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, (list, tuple, bytes, bytearray)) or hasattr(value, "__len__") and not isinstance(value, str):
        return {"len": len(value), "head": [plain(v) for v in value[:HEAD]]}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def qos(topic):
    latched = topic in ("/tf_static", "/swerve/lanes") or topic.endswith("enabled")
    durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
    reliable = latched and Policy.Reliability.Reliable(10**8) or Policy.Reliability.BestEffort
    return Qos(reliable, durability, Policy.History.KeepLast(100))


def main():
    domain, seconds = int(sys.argv[1]), float(sys.argv[2])
    participant, readers, seen = DomainParticipant(domain), {}, {}
    for line in iter(sys.stdin.readline, "\n"):
        if not line.strip():
            break
        topic, name = line.split()
        policy = qos(topic)
        readers[topic] = DataReader(
            participant, Topic(participant, f"rt{topic}", ros(name), qos=policy), qos=policy
        )
        seen[topic] = {"type": name, "n": 0}
    print("ready", flush=True)
    closed = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), closed.set()), daemon=True).start()
    begin = None
    while not closed.is_set() and (begin is None or time.monotonic() - begin < seconds):
        for topic, reader in readers.items():
            for sample in reader.take(N=100):
                if not sample.sample_info.valid_data:
                    continue
                now = time.monotonic()
                begin = begin or now
                one = seen[topic]
                one["n"] += 1
                one.setdefault("first", sample)
                one.setdefault("first_s", now - begin)
                one["last"], one["last_s"] = sample, now - begin
        time.sleep(0.005)
    for one in seen.values():
        one.update({key: plain(one[key]) for key in ("first", "last") if key in one})
    print(json.dumps(seen), flush=True)


main()
