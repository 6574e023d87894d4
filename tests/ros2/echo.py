"""Sends back what it receives, decoded and encoded again: python3 echo.py DOMAIN reliable|best_effort|latched

Topics: rt/echo/in/PACKAGE/NAME to rt/echo/out/PACKAGE/NAME, for every message of messages.idl that is named on
standard input, one `PACKAGE/NAME` a line. Prints `ready`, and ends when standard input is closed.
"""

import sys
import threading

from cyclonedds.core import GuardCondition, ReadCondition, SampleState, InstanceState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from ros_types import ros


def qos(name):
    best_effort = name == "best_effort"
    durability = Policy.Durability.TransientLocal if name == "latched" else Policy.Durability.Volatile
    reliability = Policy.Reliability.BestEffort if best_effort else Policy.Reliability.Reliable(duration(seconds=1))
    return Qos(reliability, durability, Policy.History.KeepLast(1 if name == "latched" else 100))


def main():
    domain, policy = int(sys.argv[1]), qos(sys.argv[2])
    participant = DomainParticipant(domain)
    waits, pairs, stop = WaitSet(participant), [], GuardCondition(participant)
    waits.attach(stop)
    for line in iter(sys.stdin.readline, "\n"):
        name = line.strip()
        if not name:
            break
        cls = ros(name)
        reader = DataReader(participant, Topic(participant, f"rt/echo/in/{name}", cls, qos=policy), qos=policy)
        writer = DataWriter(participant, Topic(participant, f"rt/echo/out/{name}", cls, qos=policy), qos=policy)
        any_state = SampleState.Any | ViewState.Any | InstanceState.Any
        condition = ReadCondition(reader, any_state)
        waits.attach(condition)
        pairs.append((reader, writer, condition))
    print("ready", flush=True)

    def end():
        sys.stdin.read()
        stop.set(True)

    threading.Thread(target=end, daemon=True).start()
    while not stop.read():
        waits.wait(duration(seconds=1))
        for reader, writer, condition in pairs:
            if condition.triggered:
                for sample in reader.take(N=100):
                    if getattr(sample, "sample_info", None) is None or sample.sample_info.valid_data:
                        writer.write(sample)


main()
