"""A model of the rules by which KITTI's development kit evaluates boxes in the image: plain Python, no dependency.

Written from the description of the rules: one pass over all scores finds what is right and at which scores recall rises
by a fortieth; at each of these scores a second pass counts right and wrong.
"""

CLASSES = [("Car", "Van", 0.7), ("Pedestrian", "Person_sitting", 0.5), ("Cyclist", None, 0.5)]
LEVELS = [(40, 0, 0.15), (25, 1, 0.30), (25, 2, 0.50)]
COUNTS, LEFT_OUT, OTHER = 0, 1, -1


def overlap(a, b, of_a=False):
    w, h = min(a[2], b[2]) - max(a[0], b[0]), min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0.0
    area_a, area_b = (a[2] - a[0]) * (a[3] - a[1]), (b[2] - b[0]) * (b[3] - b[1])
    return w * h / (area_a if of_a else area_a + area_b - w * h)


def roles(frame, name, neighbour, level):
    low, occluded, truncated = level
    truth = []
    for kind, truncation, occlusion, box in frame["truth"]:
        hard = occlusion > occluded or truncation > truncated or box[3] - box[1] <= low
        truth.append(LEFT_OUT if kind == neighbour or (kind == name and hard) else COUNTS if kind == name else OTHER)
    found = [LEFT_OUT if box[3] - box[1] < low else COUNTS if kind == name else OTHER for kind, box, _ in frame["found"]]
    return truth, found


def scores_that_are_right(frame, truth, found, least):
    taken, scores = set(), []
    for (_, _, _, box), role in zip(frame["truth"], truth):
        if role == OTHER:
            continue
        near = [d for d, (_, b, _) in enumerate(frame["found"])
                if found[d] != OTHER and d not in taken and overlap(b, box) > least]
        if not near:
            continue
        best = max(near, key=lambda d: (frame["found"][d][2], -d))
        taken.add(best)
        if role == COUNTS and found[best] == COUNTS:
            scores.append(frame["found"][best][2])
    return scores


def count(frame, truth, found, least, score):
    sure = {d for d, (_, _, s) in enumerate(frame["found"]) if s >= score and found[d] != OTHER}
    taken, right = set(), 0
    for (_, _, _, box), role in zip(frame["truth"], truth):
        if role == OTHER:
            continue
        near = [d for d in sorted(sure - taken) if overlap(frame["found"][d][1], box) > least]
        full = [d for d in near if found[d] == COUNTS]
        if full:
            best = max(full, key=lambda d: (overlap(frame["found"][d][1], box), -d))
        elif near:
            best = near[0]
        else:
            continue
        taken.add(best)
        right += role == COUNTS and found[best] == COUNTS
    regions = [box for kind, _, _, box in frame["truth"] if kind == "DontCare"]
    wrong = 0
    for d in sure - taken:
        if found[d] == COUNTS:
            wrong += not any(overlap(frame["found"][d][1], region, of_a=True) > least for region in regions)
    return right, wrong


def average_precision(frames, name, neighbour, least, level):
    judged = [(frame, *roles(frame, name, neighbour, level)) for frame in frames]
    wanted = sum(truth.count(COUNTS) for _, truth, _ in judged)
    if wanted == 0:
        return [-1, -1]
    scores = sorted((s for one in judged for s in scores_that_are_right(*one, least)), reverse=True)
    thresholds, recall = [], 0.0
    for k, s in enumerate(scores):
        here, after = (k + 1) / wanted, (k + 2) / wanted if k + 1 < len(scores) else (k + 1) / wanted
        if after - recall < recall - here and k + 1 < len(scores):
            continue
        thresholds.append(s)
        recall += 1 / 40
    precision = [0.0] * 41
    for k, s in enumerate(thresholds):
        right, wrong = map(sum, zip(*(count(*one, least, s) for one in judged)))
        precision[k] = right / (right + wrong) if right + wrong else 0.0
    envelope = [max(precision[k:]) for k in range(41)]
    return [sum(envelope[::4]) / 11, sum(envelope[1:]) / 40]


def average_precisions(frames):
    return [[average_precision(frames, *of_class, level) for level in LEVELS] for of_class in CLASSES]
