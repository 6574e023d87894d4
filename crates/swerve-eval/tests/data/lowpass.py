"""Writes lowpass.json: a seeded lateral-acceleration trace at 100 Hz, scipy's second-order Butterworth
low-pass of it (10 Hz, causal, settled on the first sample), and the largest jerk of both by numpy.
Run: pip install numpy scipy && python lowpass.py > lowpass.json
"""

import json

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

rng = np.random.default_rng(7)
t = np.arange(400) * 0.01
a_y = 6.0 * np.exp(-((t - 1.2) ** 2) / 0.1) - 5.0 * np.exp(-((t - 1.9) ** 2) / 0.15)
a_y = np.round(a_y + rng.normal(0.0, 0.08, t.size) + 0.3, 6)
b, a = butter(2, 10.0, fs=100.0)
smooth, _ = lfilter(b, a, a_y, zi=lfilter_zi(b, a) * a_y[0])
jerk = lambda x: float(np.abs(np.diff(x) / 0.01).max())
print(
    json.dumps(
        {
            "input": a_y.tolist(),
            "output": smooth.tolist(),
            "raw_jerk_max": jerk(a_y),
            "smooth_jerk_max": jerk(smooth),
        }
    )
)
