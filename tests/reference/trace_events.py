"""Holds a trace.json against the rules of the Trace Event Format, sharing nothing with what wrote it.

    python3 tests/reference/trace_events.py out/person_behind_truck/trace.json

Prints a count of what was looked at; the first broken rule ends it with exit code 1. The rules are those of "Trace
Event Format" (the document of the Chrome tracing project) as far as a run uses them: complete events (X), instants
(i), counters (C), flows (s, t, f), names of threads (M).
"""

import json
import re
import sys
from bisect import bisect_right
from collections import Counter, defaultdict

NEEDED = {
    "X": {"name", "ts", "dur", "pid", "tid"},
    "i": {"name", "ts", "pid", "tid", "s"},
    "C": {"name", "ts", "pid", "args"},
    "M": {"name", "pid", "args"},
    "s": {"name", "cat", "id", "ts", "pid", "tid"},
    "t": {"name", "cat", "id", "ts", "pid", "tid"},
    "f": {"name", "cat", "id", "ts", "pid", "tid"},
}


def nanoseconds(microseconds):
    return round(microseconds * 1000)


def slices(events):
    """Start and end of the slices of each thread, in order; they may touch, not overlap."""
    tracks = defaultdict(list)
    for event in events:
        if event["ph"] == "X":
            start = nanoseconds(event["ts"])
            assert event["dur"] >= 0, event
            tracks[event["pid"], event["tid"]].append((start, start + nanoseconds(event["dur"])))
    for track, spans in tracks.items():
        spans.sort()
        for before, after in zip(spans, spans[1:]):
            assert before[1] <= after[0], f"slices of thread {track} overlap: {before} {after}"
    return tracks


def is_bound(event, tracks):
    """Whether a slice of the flow event's thread encloses it: a flow binds to that slice, or is not drawn."""
    spans = tracks[event["pid"], event["tid"]]
    at = nanoseconds(event["ts"])
    near = spans[max(0, bisect_right(spans, (at, float("inf"))) - 2):][:2]
    return any(start <= at <= end for start, end in near)


def flows(events, tracks):
    """Each flow begins once, goes forward in time, holds on to slices on its way, and ends once or, where its frame
    came to nothing, not at all. How many there are, and how many end."""
    of = defaultdict(list)
    for event in events:
        if event["ph"] in "stf":
            of[event["cat"], event["name"], event["id"]].append(event)
    for key, steps in of.items():
        kinds = "".join(step["ph"] for step in steps)
        assert re.fullmatch("st*f?", kinds), f"flow {key}: {kinds}"
        for before, after in zip(steps, steps[1:]):
            assert before["ts"] <= after["ts"], f"flow {key} goes back in time: {before} {after}"
        for step in steps:
            assert is_bound(step, tracks), f"flow {key} hangs in the air: {step}"
        end = [step for step in steps if step["ph"] == "f"]
        assert all(step.get("bp") == "e" for step in end), f"flow {key} ends at the next slice: {end}"
    return len(of), sum(steps[-1]["ph"] == "f" for steps in of.values())


def check(path):
    with open(path, encoding="utf-8") as file:
        events = json.load(file)["traceEvents"]
    for event in events:
        missing = NEEDED[event["ph"]] - event.keys()
        assert not missing, f"{event} lacks {missing}"
        assert event["ph"] != "i" or event["s"] in ("g", "p", "t"), event
    tracks = slices(events)
    named = {(e["pid"], e["tid"]) for e in events if e["ph"] == "M" and e["name"] == "thread_name"}
    used = {(e["pid"], e["tid"]) for e in events if e["ph"] != "M" and "tid" in e}
    assert used <= named, f"threads without a name: {used - named}"
    kinds = Counter(event["ph"] for event in events)
    begun, ended = flows(events, tracks)
    print(f"{kinds['X']} slices, {begun} flows ({ended} end), {kinds['i']} instants, {kinds['C']} counts")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    try:
        check(sys.argv[1])
    except AssertionError as broken:
        sys.exit(f"{sys.argv[1]}: {broken}")
