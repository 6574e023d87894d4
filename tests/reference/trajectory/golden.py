"""Errors of the trajectories in shared/data/localization/metric_oracle by evo, the field's program.

    pip install evo==VERSION && python golden.py FOLDER > golden.json
"""
import json, sys
from importlib.metadata import version
from evo.core import metrics
from evo.core.metrics import PoseRelation, Unit
from evo.tools import file_interface

folder = sys.argv[1]
truth = file_interface.read_kitti_poses_file(f"{folder}/KITTI_00_gt.txt")
runs = []
for name in ("ORB", "SPTAM"):
    for align, scale in ((False, False), (True, False), (True, True)):
        found = file_interface.read_kitti_poses_file(f"{folder}/KITTI_00_{name}.txt")
        if align:
            found.align(truth, correct_scale=scale)
        def told(metric):
            metric.process_data((truth, found))
            return {key: float(value) for key, value in metric.get_all_statistics().items()}
        run = {"file": f"KITTI_00_{name}.txt", "align": align, "scale": scale}
        run["ape_m"] = told(metrics.APE(PoseRelation.translation_part))
        run["ape_deg"] = told(metrics.APE(PoseRelation.rotation_angle_deg))
        for delta in (1, 100):
            rpe = lambda relation: told(metrics.RPE(relation, delta=delta, delta_unit=Unit.frames, all_pairs=False))
            run[f"rpe_{delta}_m"] = rpe(PoseRelation.translation_part)
            run[f"rpe_{delta}_deg"] = rpe(PoseRelation.rotation_angle_deg)
        runs.append(run)
print(json.dumps({"evo": version("evo"), "runs": runs}, indent=1))
