#!/usr/bin/env python3
"""Reference numbers for the filter tests, from scipy; prints the body of filter_tables.rs.

    python3 make_filter_tables.py > filter_tables.rs
"""
import numpy as np
import scipy
import scipy.signal as s

n = 120
k = np.arange(n)
x = np.sin(0.11 * k) + 0.3 * np.cos(1.7 * k + 0.4) + 0.01 * k - 0.2 * (k % 7 == 3)


def table(name, doc, values):
    print(f"/// {doc}")
    print(f"pub(crate) const {name}: [f64; {len(values)}] = [")
    for v in values:
        print(f"    {v!r},")
    print("];")


print(f"//! Made by `make_filter_tables.py` with scipy {scipy.__version__}; not edited by hand.")
f = float
picks = [0, 1, 2, 17, 60, 101, 118, 119]
print(f"/// Samples that the full-rate tables hold.\npub(crate) const PICKS: [usize; {len(picks)}] = {picks};")
b, a = s.butter(4, 100, fs=1000)
table("BUTTER4_100_OF_1000", "filtfilt, Butterworth order 4, 100 Hz at 1 kHz.", [f(v) for v in s.filtfilt(b, a, x)[picks]])
b, a = s.butter(3, 12.5, fs=250)
table("BUTTER3_12_OF_250", "filtfilt, Butterworth order 3, 12.5 Hz at 250 Hz.", [f(v) for v in s.filtfilt(b, a, x)[picks]])
b, a = s.butter(1, 5, fs=250)
table("BUTTER1_5_OF_250", "filtfilt, Butterworth order 1, 5 Hz at 250 Hz.", [f(v) for v in s.filtfilt(b, a, x)[picks]])
sos = s.butter(4, 0.8, fs=1000, output="sos")
table("BUTTER4_SLOW", "sosfiltfilt, Butterworth order 4, 0.8 Hz at 1 kHz.", [f(v) for v in s.sosfiltfilt(sos, x)[picks]])
table("DECIMATED_10", "decimate by 10, zero phase.", [f(v) for v in s.decimate(x, 10, zero_phase=True)])
table("DECIMATED_3", "decimate by 3, zero phase.", [f(v) for v in s.decimate(x, 3, zero_phase=True)])
t = 0.004 * k + 0.0007 * np.sin(k)
table("GRADIENT_UNEVEN", "numpy.gradient over uneven times, edge order 2.", [f(v) for v in np.gradient(x, t, edge_order=2)[picks]])
