#!/usr/bin/env python3
"""Writes the pipelines and expected publications in `timing/`, with `execution.py` as the judge.

Usage: pipelines.py [--out DIR] [--seed N] [--cases N] [--files N] [--no-hand] [--span-ms N]

`timing/hand.json` holds small pipelines that each pin one sentence of `docs/execution.md`; `timing/random_*.json` hold
random ones. All times are multiples of 5 ms unless a case wants otherwise, so that results, deadlines, ticks and free
slots meet at the same instant all the time: ties are where an engine goes wrong.

A file is a list of cases, one a line: `{name, toml, publications}`; a publication is
`[operator index, stamp_ns, watermark_ns, visible_at_ns, reused_from_ns, [stamp read, in order at, latest, feedback]]`,
and a bare one (stamp null) has no list of reads.
"""

import argparse
import json
import pathlib
import random
import tomllib

import execution
import hand_cases

HERE = pathlib.Path(__file__).resolve().parent


def case(name, toml):
    config = tomllib.loads(toml)
    run = execution.Run(config)
    index = {op.name: i for i, op in enumerate(run.operators)}
    rows = []
    for op, p in run.run():
        row = [index[op.name], p.stamp, p.watermark, p.visible_at, p.reused_from]
        if p.stamp is not None:
            row.append([p.reads[i] for i in op.at + op.latest + op.feedback])
        rows.append(row)
    return {"name": name, "toml": toml, "publications": rows}


def write(path, cases):
    lines = (json.dumps(c, separators=(",", ":")) for c in cases)
    path.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")


# ---- random pipelines ------------------------------------------------------------------------------------------------


def value(x):
    if isinstance(x, bool):
        return "true" if x else "false"
    if isinstance(x, str):
        return f'"{x}"'
    if isinstance(x, list):
        return "[" + ", ".join(value(v) for v in x) + "]"
    if isinstance(x, dict):
        return "{ " + ", ".join(f"{k} = {value(v)}" for k, v in x.items()) + " }"
    return str(x)


def to_toml(span_ms, operators, resources):
    text = f"span_ms = {span_ms}\n"
    for op in operators:
        text += "[[operator]]\n" + "".join(f"{k} = {value(v)}\n" for k, v in op.items())
    for name, slots in resources.items():
        text += f"[resource.{name}]\nslots = {slots}\n"
    return text


def random_runtime(rng, longest_ms):
    kind = rng.random()
    if kind < 0.12:
        return {"zero": True}
    if kind < 0.72:
        return {"fixed_ms": 5 * rng.randint(1, longest_ms // 5)}
    return {"cycle_ms": [5 * rng.randint(1, longest_ms // 5) for _ in range(rng.randint(2, 4))]}


def typical_ms(runtime):
    (kind, v), = runtime.items()
    return 0 if kind == "zero" else v if kind == "fixed_ms" else max(v)


def random_policy(rng):
    n = rng.randint(1, 4)
    return rng.choice(["skip_to_latest", f"queue({n})", f"queue({n}, drop_oldest)", f"queue({n}, drop_newest)",
                       f"pipelined({n})", f"pipelined({n})", f"pipelined({n}, overtaking)"])


def random_deadline(rng, runtime):
    near = typical_ms(runtime) + 5 * rng.choice([0, 0, 0, -1, 1, 2, 3, 5, 8, -2, -4])
    deadline = {"ms": max(5, near)}
    anchor = rng.choice([None, "arrival", "stamp", "start"])
    if anchor:
        deadline["anchor"] = anchor
    reaction = rng.choice([None, "skip", "reuse_last", "reuse_last"])
    if reaction:
        deadline["reaction"] = reaction
    return deadline


def random_pipeline(rng, span_ms=None):
    n = rng.randint(3, 8)
    sources = rng.randint(1, min(3, n - 1))
    names = ["camera", "lidar", "radar", "detect", "fuse", "track", "predict", "plan"][:n]
    rng.shuffle(names)
    resources = {"gpu": rng.randint(1, 2), "npu": 1}
    busy = rng.random() < 0.5  # every second pipeline uses resources, and then at many operators
    bursts = rng.random() < 0.3  # results that wait for older ones, and then come several at once
    operators = []
    for i in range(n):
        op = {"name": names[i]}
        timer_only = i < sources or rng.random() < 0.15
        if timer_only or rng.random() < 0.12:
            op["every_ms"] = rng.choice([20, 25, 30, 40, 50, 50, 60, 100, 100])
            if rng.random() < 0.5:
                op["phase_ms"] = 5 * rng.randint(0, 12)
        inputs = names[:i]
        rng.shuffle(inputs)
        if not timer_only:
            op["at"] = [inputs.pop() for _ in range(min(len(inputs), rng.choice([1, 1, 2, 2, 3])))]
        if inputs and rng.random() < 0.35:
            op["latest"] = [inputs.pop() for _ in range(min(len(inputs), rng.randint(1, 2)))]
        loops = [name for name in names if name not in op.get("at", []) + op.get("latest", [])]
        if loops and rng.random() < 0.25:
            op["feedback"] = [rng.choice(loops)]
        op["runtime"] = random_runtime(rng, 40 if i < sources else rng.choice([20, 60, 150]))
        if bursts and rng.random() < 0.7:
            op["runtime"] = {"cycle_ms": [5 * rng.choice([1, 2, 3, 8, 12, 16]) for _ in range(rng.randint(2, 4))]}
            op["policy"] = f"pipelined({rng.randint(2, 4)})"
        elif rng.random() < 0.8:
            op["policy"] = random_policy(rng)
        if rng.random() < 0.45:
            op["deadline"] = random_deadline(rng, op["runtime"])
        if busy and rng.random() < 0.6:
            op["uses"] = rng.choice(["gpu", "gpu", "npu"])
        operators.append(op)
    if rng.random() < 0.5:
        rng.shuffle(operators)  # declaration order is not rank order
    used = {op.get("uses") for op in operators}
    span = span_ms or 5 * rng.randint(40, 80)
    return to_toml(span, operators, {k: v for k, v in resources.items() if k in used})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=pathlib.Path, default=HERE / "timing")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=280)
    parser.add_argument("--files", type=int, default=4)
    parser.add_argument("--span-ms", type=int)
    parser.add_argument("--no-hand", action="store_true")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    cases = [case(f"random {args.seed}.{i}", random_pipeline(random.Random(f"{args.seed}.{i}"), args.span_ms))
             for i in range(args.cases)]
    for k in range(args.files):
        write(args.out / f"random_{k}.json", cases[k::args.files])
    if not args.no_hand:
        for line in hand_cases.differences():
            raise SystemExit(line)
        write(args.out / "hand.json", [case(name, toml) for name, toml, _ in hand_cases.CASES])


if __name__ == "__main__":
    main()
