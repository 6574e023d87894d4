#!/usr/bin/env python3
"""A reference model of the time rules, for `swerve timing` files.

Usage: execution.py FILE.toml        prints the JSON array of `swerve timing --json`

Written from `docs/execution.md` alone, sentence by sentence, and from nothing else: it shares no code and no data
structure with the engine, so that a disagreement between the two is worth reading the page again. It is slow on
purpose. Nothing is cached that can be looked up in the list of what happened; every instant visits every operator.

All times are integer nanoseconds. Run times that need random numbers are refused: they are the engine's own business.
Comments name the section of the page that a line follows.
"""

import json
import re
import sys
import tomllib

MS = 1_000_000


def ns(ms):
    return round(ms * MS)


class Publication:
    """One entry of a stream: a message, or a bare watermark (stamp None)."""

    def __init__(self, stamp, watermark, visible_at, reused_from, reads):
        self.stamp, self.watermark, self.visible_at = stamp, watermark, visible_at
        self.reused_from, self.reads = reused_from, reads


class Step:
    """A step that was started; it stays in the operator's list for good."""

    def __init__(self, stamp, start, end, reads):
        self.stamp, self.start, self.end, self.reads = stamp, start, end, reads


class Frame:
    """What the synchronised ports hold for one stamp (section 1), and how far it has come."""

    def __init__(self, stamp, opened_at):
        self.stamp, self.opened_at = stamp, opened_at
        self.messages = set()  # names of the At inputs that carry this stamp
        self.state = "incomplete"  # then "waiting", "running", and at last what resolved it
        self.deadline = None
        self.step = None

    @property
    def open(self):
        return self.state in ("incomplete", "waiting", "running")


class Operator:
    def __init__(self, table):
        self.name = table["name"]
        self.at = list(table.get("at", []))
        self.latest = list(table.get("latest", []))
        self.feedback = list(table.get("feedback", []))
        self.every = ns(table["every_ms"]) if "every_ms" in table else None
        self.next_tick = ns(table.get("phase_ms", 0)) if self.every else None
        self.runtime = table["runtime"]
        self.policy, self.places, self.bound, self.full, self.overtaking = policy(table.get("policy", "skip_to_latest"))
        self.deadline = table.get("deadline")
        self.resource = table.get("uses")
        self.taken = {name: 0 for name in self.at}  # publications of each At input taken in so far
        self.frames = {}  # by stamp
        self.steps = []  # in start order
        self.stream = []  # publications in commit order
        self.floor = None  # newest stamp published or reacted for
        self.ready_since = None
        self.dropped = self.missed = 0

    def open_frames(self):
        return [self.frames[t] for t in sorted(self.frames) if self.frames[t].open]

    def in_state(self, state):
        return [f for f in self.open_frames() if f.state == state]

    def next_runtime(self):
        """Section 4, the table. `cycle`: in turn, by the number of steps started so far."""
        (kind, value), = self.runtime.items()
        if kind == "zero":
            return 0
        if kind == "fixed_ms":
            return ns(value)
        if kind == "cycle_ms":
            return ns(value[len(self.steps) % len(value)])
        raise SystemExit(f"{self.name}: run time `{kind}` needs the engine's random numbers")


def policy(text):
    """Section 5: (kind, places, waiting bound, what goes when full, overtaking)."""
    if text == "skip_to_latest":
        return ("pipelined", 1, None, None, False)  # "skip_to_latest (the default) is pipelined(1)"
    m = re.fullmatch(r"queue\((\d+)(?:, *(drop_oldest|drop_newest))?\)", text)
    if m:
        return ("queue", 1, int(m[1]), m[2] or "drop_oldest", False)
    m = re.fullmatch(r"pipelined\((\d+)(, *overtaking)?\)", text)
    if m:
        return ("pipelined", int(m[1]), None, None, m[2] is not None)
    raise SystemExit(f"policy `{text}`")


class Run:
    def __init__(self, config):
        self.span = ns(config["span_ms"])
        self.operators = [Operator(table) for table in config["operator"]]
        self.by_name = {op.name: op for op in self.operators}
        self.slots = {name: table["slots"] for name, table in config.get("resource", {}).items()}
        self.commits = []  # (operator, publication)
        self.now = None
        self.ranked = self.ranks()

    def ranks(self):
        """Section 1, Rank: one by one, to the operator declared first among those whose At and Latest inputs have one."""
        ranked = []
        while len(ranked) < len(self.operators):
            ready = [op for op in self.operators if op not in ranked
                     and all(self.by_name[i] in ranked for i in op.at + op.latest)]
            if not ready:
                raise SystemExit("a cycle without a feedback edge")  # section 2, rule 4
            ranked.append(ready[0])
        return ranked

    # ---- section 1: watermarks -------------------------------------------------------------------------------

    def port_watermarks(self, op):
        """The watermark of every synchronised port; None where a stream had no publication yet."""
        marks = [self.by_name[i].stream[-1].watermark if self.by_name[i].stream else None for i in op.at]
        if op.every:
            # First phase - 1 ns, then the next tick - 1 ns once the present tick is taken in.
            marks.append(op.next_tick - 1)
        return marks

    def ports_cover(self, op):
        """The smallest watermark of the synchronised ports, None where one has none."""
        marks = self.port_watermarks(op)
        return None if None in marks else min(marks)

    def watermark(self, op):
        """The smallest of the ports' watermarks and the stamp just below the oldest open one, but never below the
        newest stamp that it published or reacted for."""
        mark = self.ports_cover(op)
        if mark is not None and op.open_frames():
            mark = min(mark, op.open_frames()[0].stamp - 1)
        if mark is None or (op.floor is not None and op.floor > mark):
            mark = op.floor
        return mark

    def commit(self, op, stamp, reused_from, reads):
        publication = Publication(stamp, self.watermark(op), self.now, reused_from, reads)
        op.stream.append(publication)
        self.commits.append((op, publication))

    def publish_watermark_if_it_rose(self, op):
        """(f). When it rises without a message, a bare publication carries it at the end of the turn."""
        mark = self.watermark(op)
        if mark is None:
            return False
        if op.stream and mark <= op.stream[-1].watermark:
            return False
        self.commit(op, None, None, {})
        return True

    # ---- sections 1 and 2: opening frames --------------------------------------------------------------------

    def open_frame(self, op, stamp):
        """The frame that a message or tick with this stamp belongs to, opened by the first one."""
        if op.floor is not None and stamp <= op.floor:
            return None  # a message at or below that one opens no frame
        if stamp not in op.frames:
            frame = op.frames[stamp] = Frame(stamp, self.now)
            if op.deadline:  # section 6, rule 1
                anchor = op.deadline.get("anchor", "arrival")
                if anchor == "arrival":
                    frame.deadline = self.now + ns(op.deadline["ms"])
                elif anchor == "stamp":
                    frame.deadline = stamp + ns(op.deadline["ms"])
                # "start": set when its step starts
        return op.frames[stamp]

    def take_in(self, op):
        """Messages and ticks that became visible; whole publications of one sweep precede the reader's turn."""
        if op.every and op.next_tick <= self.now:
            self.open_frame(op, op.next_tick)
            op.next_tick += op.every
        for name in op.at:
            stream = self.by_name[name].stream
            while op.taken[name] < len(stream):
                stamp = stream[op.taken[name]].stamp
                op.taken[name] += 1
                if stamp is not None:
                    frame = self.open_frame(op, stamp)
                    if frame and frame.open:
                        frame.messages.add(name)

    # ---- section 6, rule 3: publishing resolves what is older ---------------------------------------------------

    def resolve_up_to(self, op, stamp, own):
        """Publishing `stamp` resolves all older open stamps: waiting ones are dropped, running ones not published."""
        for frame in op.open_frames():
            if frame.stamp < stamp:
                frame.state = "given up"
                op.dropped += 1
        op.frames[stamp].state = own
        op.floor = stamp if op.floor is None else max(op.floor, stamp)

    # ---- section 3: the sweep ----------------------------------------------------------------------------------

    def a_publish_results_due(self, op):
        """(a) publishes results due now, in stamp order."""
        changed = False
        for frame in op.in_state("running"):
            if not frame.open:
                continue
            if frame.step.end > self.now:
                if op.overtaking:
                    continue  # section 5: a newer result may come first
                break  # section 5: published at max(own end, previous publication)
            self.resolve_up_to(op, frame.stamp, "published")
            self.commit(op, frame.stamp, None, frame.step.reads)
            changed = True
        return changed

    def b_handle_deadlines(self, op):
        """(b) handles deadlines expired now or already past when their frame opened, in stamp order."""
        changed = False
        for frame in op.open_frames():
            if frame.open and frame.deadline is not None and frame.deadline <= self.now:
                self.react(op, frame)
                changed = True
        return changed

    def react(self, op, frame):
        """Section 6, rule 3: on a miss, exactly one reaction publishes."""
        op.missed += 1
        result = None
        if op.deadline.get("reaction", "skip") == "reuse_last":
            if frame.step is not None and frame.step.end <= self.now:
                result = frame.step  # the step's own result if it only waits for an older one
            else:  # the newest finished result: highest stamp whose modelled end has come, published or not
                finished = [step for step in op.steps if step.end <= self.now]
                result = max(finished, key=lambda step: step.stamp, default=None)
        self.resolve_up_to(op, frame.stamp, "missed")
        if result is not None:  # else as `skip`: no message; (f) carries the watermark
            # A step's own result is no repeat of another one's.
            self.commit(op, frame.stamp, None if result is frame.step else result.stamp, result.reads)

    def c_take_complete_frames(self, op):
        """(c). Section 2, rule 1: complete when the watermark of every synchronised port is >= t."""
        changed = False
        cover = self.ports_cover(op)
        for frame in op.in_state("incomplete"):
            if cover is not None and cover >= frame.stamp:
                frame.state = "waiting"
                changed = True
        return changed

    def free_places(self, op):
        """Section 4: a step holds its place until its modelled end, and on until its publication where that waits."""
        held = [step for step in op.steps if step.end > self.now or op.frames[step.stamp].open]
        return op.places - len(held)

    def next_to_start(self, op):
        """Section 5, what starts when free; drops what the choice passes over. None: nothing may start."""
        free = self.free_places(op)
        waiting = op.in_state("waiting")
        if free <= 0 or not waiting:
            return None
        if op.policy == "queue":
            return waiting[0]
        for frame in waiting[:-free]:  # with k places free, the k newest waiting frames, older ones dropped
            self.drop(op, frame)
        return waiting[-free:][0]

    def drop(self, op, frame):
        frame.state = "dropped"  # section 5: dropping a frame ends its deadline without reaction
        op.dropped += 1

    def start(self, op, frame):
        """Section 4: done at s + runtime. The Latest inputs are read now (section 2, rules 3 and 4)."""
        reads = {name: frame.stamp if name in frame.messages else None for name in op.at}
        for name in op.latest:
            reads[name] = self.highest_stamp(p for p in self.by_name[name].stream)
        for name in op.feedback:
            reads[name] = self.highest_stamp(p for p in self.by_name[name].stream if p.visible_at < self.now)
        frame.step = Step(frame.stamp, self.now, self.now + op.next_runtime(), reads)
        frame.state = "running"
        op.steps.append(frame.step)
        if op.deadline and op.deadline.get("anchor", "arrival") == "start":
            frame.deadline = self.now + ns(op.deadline["ms"])

    @staticmethod
    def highest_stamp(publications):
        return max((p.stamp for p in publications if p.stamp is not None), default=None)

    def d_start(self, op):
        """(d) starts what its busy policy allows."""
        changed = False
        while (frame := self.next_to_start(op)) is not None:
            self.start(op, frame)
            changed = True
        return changed

    def e_apply_bound(self, op):
        """(e) applies its queue bound. Section 5: `pipelined` keeps the newest waiting frame only."""
        waiting = op.in_state("waiting")
        bound = op.bound if op.policy == "queue" else 1
        while len(waiting) > bound:
            self.drop(op, waiting.pop() if op.full == "drop_newest" else waiting.pop(0))

    def turn(self, op):
        self.take_in(op)
        while True:  # repeats (a)-(d) until nothing changes
            changed = self.a_publish_results_due(op)
            changed |= self.b_handle_deadlines(op)
            changed |= self.c_take_complete_frames(op)
            if op.resource is None or op.next_runtime() == 0:
                # "A step of zero run time needs no slot", so it does not wait for the last turn either: started after
                # it, its result would be due at this very instant, and nothing would sweep the instant again.
                changed |= self.d_start(op)
            if not changed:
                break
        if op.resource is None:
            self.e_apply_bound(op)
            self.publish_watermark_if_it_rose(op)

    # ---- section 4: resources ----------------------------------------------------------------------------------

    def free_slots(self, resource):
        """A slot is free again at the modelled end; a step of zero run time needs none."""
        held = [s for op in self.operators if op.resource == resource for s in op.steps if s.end > self.now]
        return self.slots[resource] - len(held)

    def note_readiness(self):
        """Since when each operator has had a complete frame and a free place without a start."""
        for op in self.users():
            ready = op.in_state("waiting") and self.free_places(op) > 0
            if not ready:
                op.ready_since = None
            elif op.ready_since is None:
                op.ready_since = self.now

    def users(self):
        return [op for op in self.ranked if op.resource is not None]

    def start_on_resources(self):
        """Steps start after the last turn, as slots are free, in order of (instant ready since, rank)."""
        while True:
            self.note_readiness()
            able = [op for op in self.users() if op.ready_since is not None and self.free_slots(op.resource) > 0]
            if not able:
                return
            op = min(able, key=lambda op: (op.ready_since, self.ranked.index(op)))
            self.start(op, self.next_to_start(op))
            op.ready_since = None

    def resource_phase(self):
        """True when the instant has to be swept once more."""
        self.start_on_resources()
        again = False
        for op in self.users():  # then (e) and (f) of these operators, in rank order
            self.e_apply_bound(op)
            again |= self.publish_watermark_if_it_rose(op)
        return again

    # ---- the run -------------------------------------------------------------------------------------------------

    def next_instant(self):
        due = []
        for op in self.operators:
            if op.every:
                due.append(op.next_tick)
            due += [step.end for step in op.steps]
            due += [f.deadline for f in op.open_frames() if f.deadline is not None]
        return min((instant for instant in due if instant > self.now), default=None)

    def run(self):
        self.now = 0  # section 1: a run starts with a sweep at instant 0
        while self.now is not None and self.now <= self.span:  # the span's end is included
            while True:
                for op in self.ranked:
                    self.turn(op)
                if not self.resource_phase():
                    break
            self.now = self.next_instant()
        return self.commits


def publications(text):
    """The rows of `swerve timing --json` for a pipeline given as TOML text."""
    return [{"operator": op.name, "stamp_ns": p.stamp, "watermark_ns": p.watermark, "visible_at_ns": p.visible_at,
             "reused_from_ns": p.reused_from, "reads": p.reads} for op, p in Run(tomllib.loads(text)).run()]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    with open(sys.argv[1], encoding="utf-8") as file:
        rows = publications(file.read())
    print("[" + ",\n".join(json.dumps(row) for row in rows) + "]")
