"""Errors of made-up predictions by av2 (Argoverse 2's own metrics), densities and quantiles by SciPy.

    pip install av2 scipy && python golden.py > golden.json
"""
import json
from importlib.metadata import version
import numpy as np
from av2.datasets.motion_forecasting.eval import metrics
from scipy.stats import chi2, multivariate_normal

rng = np.random.Generator(np.random.PCG64(1))
ACTORS, MODES, STEPS = 3, 4, 6
truth = np.cumsum(rng.normal(0.5, 0.4, (ACTORS, STEPS, 2)), axis=1)
spread = np.array([0.05, 0.4, 0.8, 2.0])[None, :, None, None]
paths = truth[:, None] + np.cumsum(rng.normal(0, 1, (ACTORS, MODES, STEPS, 2)) * spread, axis=2)
probabilities = np.array([0.15, 0.5, 0.3, 0.05])
covariances = []
for _ in range(ACTORS * MODES * STEPS):
    a = rng.normal(0, 1, (2, 2))
    covariances.append(a @ a.T + 0.2 * np.eye(2))
covariances = np.array(covariances).reshape(ACTORS, MODES, STEPS, 2, 2)


def nll(actor, step):
    parts = [p * multivariate_normal(paths[actor, k, step], covariances[actor, k, step]).pdf(truth[actor, step])
             for k, p in enumerate(probabilities)]
    return -np.log(np.sum(parts))


print(json.dumps({
    "av2": version("av2"), "scipy": version("scipy"),
    "probabilities": probabilities.tolist(), "truth": truth.tolist(), "paths": paths.tolist(),
    "covariances": covariances[..., [0, 0, 1], [0, 1, 1]].tolist(),
    "ade": [metrics.compute_ade(p, g).tolist() for p, g in zip(paths, truth)],
    "fde": [metrics.compute_fde(p, g).tolist() for p, g in zip(paths, truth)],
    "missed": [metrics.compute_is_missed_prediction(p, g).tolist() for p, g in zip(paths, truth)],
    "brier_fde": [metrics.compute_brier_fde(p, g, probabilities).tolist() for p, g in zip(paths, truth)],
    "world_ade": metrics.compute_world_ade(paths, truth).tolist(),
    "world_fde": metrics.compute_world_fde(paths, truth).tolist(),
    "world_misses": metrics.compute_world_misses(paths, truth).tolist(),
    "nll": [[nll(m, t) for t in range(STEPS)] for m in range(ACTORS)],
    "chi2": {str(share): float(chi2(2).ppf(share)) for share in (0.5, 0.8, 0.9, 0.95)},
}))
