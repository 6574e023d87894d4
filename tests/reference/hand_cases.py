"""Small pipelines, each for one sentence of `docs/execution.md`, with what it says must happen, worked out by hand.

A case is `(name, toml, expected)`: per operator the messages as `stamp@instant` in ms, `stamp@instant<computed` for a
repeat, and `~watermark@instant` for a bare publication (`~49+` is 50 ms - 1 ns); bare ones are compared only where
the expectation has one. `"reader.input"` lists the stamps that the reader's messages read there, `-` for none.
`python3 hand_cases.py` checks the reference model against them; it prints only what differs.
"""

import tomllib

import execution


def op(name, **keys):
    def value(v):
        if isinstance(v, bool):
            return str(v).lower()
        if isinstance(v, dict):
            return "{ " + ", ".join(f"{k} = {value(x)}" for k, x in v.items()) + " }"
        if isinstance(v, list):
            return "[" + ", ".join(value(x) for x in v) + "]"
        return f'"{v}"' if isinstance(v, str) else str(v)

    return "[[operator]]\n" + "".join(f"{k} = {value(v)}\n" for k, v in {"name": name, **keys}.items())


def timer(name, every, fixed=None, phase=0, **keys):
    runtime = {"zero": True} if fixed is None else {"fixed_ms": fixed}
    return op(name, every_ms=every, phase_ms=phase, runtime=runtime, **keys)


def pipeline(span, *operators, **slots):
    resources = "".join(f"[resource.{name}]\nslots = {n}\n" for name, n in slots.items())
    return f"span_ms = {span}\n" + "".join(operators) + resources


def fixed(ms):
    return {"fixed_ms": ms}


ZERO = {"zero": True}


def worked_example(policy, published):
    return (f"5 worked example {policy}",
            pipeline(2200, timer("sensor", 50), op("worker", at=["sensor"], runtime=fixed(550), policy=policy)),
            {"worker": published})


CASES = [
    worked_example("skip_to_latest", "0@550 550@1100 1100@1650 1650@2200"),
    worked_example("queue(2)", "0@550 450@1100 1000@1650 1550@2200"),
    worked_example("queue(2, drop_newest)", "0@550 50@1100 100@1650 550@2200"),
    worked_example("pipelined(64)", " ".join(f"{t}@{t + 550}" for t in range(0, 1651, 50))),
    worked_example("pipelined(4)", "0@550 50@600 100@650 150@700 550@1100 600@1150 650@1200 700@1250 1100@1650 "
                                   "1150@1700 1200@1750 1250@1800 1650@2200"),

    ("1 a run starts with a sweep at 0, a timer port starts at phase - 1 ns",
     pipeline(30, timer("late", 50, phase=20), op("reader", at=["late"], runtime=fixed(5))),
     {"late": "~19+@0 20@20", "reader": "~19+@0 20@25"}),
    ("1 a timer port that has taken a tick in stands just below the next",
     pipeline(60, timer("camera", 50, 5)),
     {"camera": "~-1+@0 0@5 50@55"}),
    ("1 a 50 ms camera does not wait for the next tick of a 100 ms lidar",
     pipeline(160, timer("camera", 50), timer("lidar", 100), op("join", at=["camera", "lidar"], runtime=fixed(10))),
     {"join": "~-1+@0 0@10 50@60 100@110 150@160", "join.lidar": "0 - 100 -"}),
    ("1 an operator that does not fire passes the watermark on",
     pipeline(100, timer("camera", 50), op("busy", at=["camera"], runtime=fixed(120)),
              op("next", at=["busy"], runtime=ZERO)),
     {"busy": "~-1+@0", "next": "~-1+@0"}),
    ("1 ranks do not follow the order of declaration",
     pipeline(40, op("last", at=["middle"], latest=["first"], runtime=ZERO), op("middle", at=["first"], runtime=ZERO),
              timer("first", 20)),
     {"last": "0@0 20@20 40@40", "last.first": "0 20 40"}),
    ("2.1 frames exist for the union of the stamps",
     pipeline(60, timer("a", 30), timer("b", 50, phase=10), op("join", at=["a", "b"], runtime=ZERO)),
     {"join": "0@0 10@10 30@30 60@60", "join.a": "0 - 30 60", "join.b": "- 10 - 60"}),
    ("2.2 a timer and At inputs are joined by stamp",
     pipeline(60, timer("camera", 50, 5), op("both", every_ms=20, at=["camera"], runtime=ZERO)),
     {"both": "~-1+@0 0@5 20@20 40@40 50@55 60@60", "both.camera": "0 - - 50 -"}),
    ("2.3 Latest shows what is visible when the step starts, and its stamp may exceed the frame's",
     pipeline(60, timer("pose", 20, 5), timer("camera", 30, 30), op("use", at=["camera"], latest=["pose"],
                                                                     runtime=ZERO)),
     {"use": "0@30 30@60", "use.pose": "20 40"}),
    ("2.4 feedback shows what was visible strictly before",
     pipeline(40, op("world", every_ms=20, feedback=["control"], runtime=ZERO),
              op("control", at=["world"], runtime=ZERO)),
     {"world": "0@0 20@20 40@40", "control": "0@0 20@20 40@40", "world.control": "- 0 20"}),
    ("2.4 an operator may read its own stream through feedback",
     pipeline(60, op("filter", every_ms=20, feedback=["filter"], runtime=fixed(20))),
     {"filter": "~-1+@0 0@20 20@40 40@60", "filter.filter": "- - 0"}),

    ("3 a result due exactly at its deadline is in time",
     pipeline(100, timer("camera", 50), op("work", at=["camera"], runtime=fixed(20), deadline={"ms": 20})),
     {"work": "~-1+@0 0@20 50@70"}),
    ("3 a frame not started when (b) comes at its deadline is missed",
     pipeline(110, timer("camera", 20), op("work", at=["camera"], runtime={"cycle_ms": [40, 10]}, policy="queue(2)",
                                            deadline={"ms": 20})),
     {"work": "~-1+@0 ~19+@20 ~39+@40 40@50 ~79+@80 ~99+@100 100@110"}),
    ("3 in one turn results come before deadlines and deadlines before starts",
     pipeline(120, timer("camera", 20), op("work", at=["camera"], runtime={"cycle_ms": [60, 20]}, policy="queue(3)",
                                            deadline={"ms": 40, "reaction": "reuse_last"})),
     {"work": "~-1+@0 ~19+@40 20@60<0 40@80 60@100<40 80@120<40"}),
    ("3 deadlines of one turn are handled in stamp order",
     pipeline(130, timer("burst", 20, policy="pipelined(4)").replace("{ zero = true }", "{ cycle_ms = [50, 30] }"),
              op("work", at=["burst"], runtime={"cycle_ms": [100, 10]}, policy="pipelined(2)",
                 deadline={"ms": 40, "reaction": "reuse_last"})),
     {"burst": "~-1+@0 0@50 20@50 40@90 60@90 80@130 100@130",
      "work": "~-1+@0 0@90<20 20@90 ~59+@90 60@130<20 ~99+@130"}),

    ("4 cycle counts the steps started",
     pipeline(200, timer("camera", 50), op("work", at=["camera"], runtime={"cycle_ms": [60, 10]})),
     {"work": "~-1+@0 0@60 50@70 100@160 150@170"}),
    ("4 one slot, two operators, none starves",
     pipeline(110, timer("camera", 20), op("first", at=["camera"], runtime=fixed(20), uses="gpu"),
              op("second", at=["camera"], runtime=fixed(20), uses="gpu"), gpu=1),
     {"first": "~-1+@0 0@20 ~39+@40 40@60 ~79+@80 80@100", "second": "~-1+@0 ~19+@20 20@40 ~59+@60 60@80 ~99+@100"}),
    ("4 a frame that lacks only a slot waits as if no place were free",
     pipeline(100, timer("camera", 20), op("hog", at=["camera"], runtime=fixed(70), uses="gpu"),
              op("late", at=["camera"], runtime=fixed(10), uses="gpu", policy="pipelined(2)"), gpu=1),
     {"hog": "~-1+@0 0@70 ~79+@80", "late": "~-1+@0 ~19+@20 ~39+@40 ~59+@60 60@80 ~99+@100"}),
    ("4 of the frames that the policy would start, the first takes the only slot",
     pipeline(70, timer("burst", 20, policy="pipelined(4)").replace("{ zero = true }", "{ cycle_ms = [50, 30] }"),
              op("work", at=["burst"], runtime=fixed(10), policy="pipelined(2)", uses="gpu"), gpu=1),
     {"burst": "~-1+@0 0@50 20@50", "work": "~-1+@0 0@60 20@70"}),
    ("4 a watermark that rises after the last turn has the instant swept once more",
     pipeline(100, timer("camera", 20), op("hog", at=["camera"], runtime=fixed(50), uses="gpu"),
              op("late", at=["camera"], runtime=fixed(10), uses="gpu"),
              op("join", at=["camera", "late"], runtime=ZERO), gpu=1),
     {"late": "~-1+@0 ~19+@20 ~39+@40 40@60 ~79+@80 ~99+@100", "join": "~-1+@0 0@20 20@40 40@60 60@80 80@100"}),
    ("4 a step of zero run time needs no slot",
     pipeline(40, timer("camera", 20), op("hog", at=["camera"], runtime=fixed(100), uses="gpu"),
              op("quick", at=["camera"], runtime=ZERO, uses="gpu"),
              op("reader", at=["camera"], latest=["quick"], runtime=ZERO), gpu=1),
     {"quick": "0@0 20@20 40@40", "reader.quick": "0 20 40"}),
    ("4 watermarks after the last turn pass on in rank order, and the instant is swept once more for the others",
     pipeline(20, timer("camera", 20), op("hog", at=["camera"], runtime=fixed(50), uses="gpu"),
              op("late", at=["camera"], runtime=fixed(50), uses="gpu"),
              op("plain", at=["late"], runtime=ZERO), op("user", at=["late"], runtime=fixed(5), uses="npu"),
              gpu=1, npu=1),
     {"late": "~-1+@0 ~19+@20", "plain": "~-1+@0 ~19+@20", "user": "~-1+@0 ~19+@20"}),
    ("4 a slot is free at the modelled end though the result waits",
     pipeline(200, timer("camera", 20), op("work", at=["camera"], runtime={"cycle_ms": [90, 10]},
                                            policy="pipelined(4)", uses="gpu"), gpu=2),
     {"work": "~-1+@0 0@90 20@90 40@130 80@130 100@190 120@190"}),

    ("5 pipelined publishes in stamp order",
     pipeline(120, timer("camera", 20), op("work", at=["camera"], runtime={"cycle_ms": [50, 10]},
                                            policy="pipelined(3)")),
     {"work": "~-1+@0 0@50 20@50 40@90 60@90"}),
    ("5 overtaking drops what comes late",
     pipeline(120, timer("camera", 20), op("work", at=["camera"], runtime={"cycle_ms": [50, 10]},
                                            policy="pipelined(3, overtaking)")),
     {"work": "~-1+@0 20@30 60@70 100@110"}),
    ("5 readers that join on a dropped stamp see None",
     pipeline(100, timer("camera", 20), op("work", at=["camera"], runtime=fixed(50)),
              op("join", at=["camera", "work"], runtime=ZERO, policy="queue(9)")),
     {"work": "~-1+@0 0@50 40@100 ~99+@100", "join": "~-1+@0 0@50 20@50 40@100 60@100 80@100",
      "join.work": "0 - 40 - -"}),
    ("5 dropping a frame ends its deadline without reaction",
     pipeline(150, timer("camera", 20), op("work", at=["camera"], runtime=fixed(50),
                                            deadline={"ms": 75, "reaction": "reuse_last"})),
     {"work": "~-1+@0 0@50 40@100 ~99+@100 100@150"}),

    ("6.1 each stamp has a deadline of its own",
     pipeline(150, timer("camera", 50), op("work", at=["camera"], runtime={"cycle_ms": [40, 20]},
                                            deadline={"ms": 30})),
     {"work": "~-1+@0 ~49+@30 50@70 ~149+@130"}),
    ("6.1 anchor stamp: a deadline already past when the frame opens",
     pipeline(150, timer("camera", 50, 30), op("work", at=["camera"], runtime=fixed(5),
                                               deadline={"ms": 20, "anchor": "stamp"})),
     {"work": "~-1+@0 ~49+@30 ~99+@80 ~149+@130"}),
    ("6.1 anchor start",
     pipeline(150, timer("camera", 50), op("work", at=["camera"], runtime={"cycle_ms": [60, 20]}, policy="queue(1)",
                                            deadline={"ms": 20, "anchor": "start", "reaction": "reuse_last"})),
     {"work": "~-1+@0 ~49+@20 50@80 100@120<50"}),
    ("6.1 a deadline runs while the frame is incomplete",
     pipeline(150, timer("camera", 50), timer("lidar", 50, 30),
              op("join", at=["camera", "lidar"], runtime=fixed(5), deadline={"ms": 20})),
     {"join": "~-1+@0 ~0@20 ~49+@30 ~50@70 ~99+@80 ~100@120 ~149+@130"}),
    ("6.3 before the first result reuse_last acts as skip",
     pipeline(150, timer("camera", 50), op("work", at=["camera"], runtime={"cycle_ms": [45, 25]},
                                            deadline={"ms": 30, "reaction": "reuse_last"})),
     {"work": "~-1+@0 ~49+@30 50@75 100@130<50"}),
    ("6.3 a repeat names the step that computed it, through any number of repeats",
     pipeline(300, timer("camera", 50), op("work", at=["camera"], runtime={"cycle_ms": [10, 200]},
                                            deadline={"ms": 30, "reaction": "reuse_last"})),
     {"work": "~-1+@0 0@10 50@80<0 100@130<0 150@180<0 200@230<0 250@260", "work.camera": "0 0 0 0 0 250"}),
    ("6.3 a late result counts as finished",
     pipeline(200, timer("camera", 50), op("work", at=["camera"], runtime={"cycle_ms": [45, 60]},
                                            deadline={"ms": 40, "reaction": "reuse_last"})),
     {"work": "~-1+@0 ~49+@40 50@90<0 100@140<50 150@190<100"}),
    ("6.3 the newest finished result may be newer than the stamp",
     pipeline(90, timer("camera", 20), op("work", at=["camera"], runtime={"cycle_ms": [10, 90, 10]},
                                           policy="pipelined(4)",
                                           deadline={"ms": 60, "anchor": "stamp", "reaction": "reuse_last"})),
     {"work": "~-1+@0 0@10 20@80<60 40@80 60@80"}),
    ("6.3 a reaction publishes the step's own result where it only waits, and resolves the older stamp",
     pipeline(110, timer("fast", 50, phase=25), timer("slow", 50, 45),
              op("join", at=["fast", "slow"], runtime={"cycle_ms": [40, 5]}, policy="pipelined(2)",
                 deadline={"ms": 30, "reaction": "reuse_last"})),
     {"join": "~-1+@0 25@55 75@105", "join.slow": "- -"}),
]


def shown(run, operator, watermarks):
    """What an operator published, in the notation above."""
    out = []
    for o, p in run.commits:
        at = f"@{p.visible_at / execution.MS:g}"
        if o.name == operator and p.stamp is not None:
            again = "" if p.reused_from is None else f"<{p.reused_from / execution.MS:g}"
            out.append(f"{p.stamp / execution.MS:g}{at}{again}")
        elif o.name == operator and watermarks:
            below, rest = divmod(p.watermark, execution.MS)
            out.append(f"~{below}{'+' if rest else ''}{at}")
    return " ".join(out)


def reads(run, operator, name):
    stamps = [p.reads[name] for o, p in run.commits if o.name == operator and p.stamp is not None]
    return " ".join("-" if t is None else f"{t / execution.MS:g}" for t in stamps)


def differences():
    """One line for each expectation that the reference model does not meet."""
    for name, toml, expected in CASES:
        run = execution.Run(tomllib.loads(toml))
        run.run()
        for key, want in expected.items():
            got = reads(run, *key.split(".")) if "." in key else shown(run, key, "~" in want)
            if got != want:
                yield f"{name}: {key}:\n  want {want}\n  got  {got}"


if __name__ == "__main__":
    for line in differences():
        print(line)
