"""Computes the spectra of `bead analyse` by endaq.calc.shock, scipy.signal and numpy, and compares them.

    python spectra_by_scipy.py SAMPLES.csv

SAMPLES.csv is the table `samples` of `bead export`. Beside it are the tables srs.csv, psd.csv and fft.csv of `bead
analyse --out`, and the documents srs.json and transfer.json.
"""

import json
import sys

import numpy as np
import pandas as pd
import scipy.signal
import scipy.stats
from endaq.calc import shock

NEAR = 1e-4
QUALITY = 10.0


def near(name, found, expected, scale=None):
    found, expected = np.asarray(found, dtype=complex), np.asarray(expected, dtype=complex)
    scale = np.abs(expected) if scale is None else scale
    off = np.max(np.abs(found - expected) / scale)
    assert off < NEAR, f"{name}: off by {off}"


samples = pd.read_csv(sys.argv[1])
strikes = [strike for _, strike in samples.groupby("id")]
rate = 1 / np.median(np.diff(strikes[0]["time_s"]))
force = [strike["force_n"].to_numpy() for strike in strikes]
acceleration = [strike["acceleration_mps2"].to_numpy() for strike in strikes]
origin = int(np.argmin(np.abs(strikes[0]["time_from_trigger_s"].to_numpy())))


def of_strike(table, number):
    return table[table["id"] == number].reset_index(drop=True)


# Shock response spectra: both sides by endaq's own function, primary and residual by its filters.
table = pd.read_csv("srs.csv")
for number, signal in enumerate(acceleration):
    rows = of_strike(table, number)
    frequencies = rows["frequency_hz"].to_numpy()
    frame = pd.DataFrame({"a": signal}, index=np.arange(len(signal)) / rate)
    for mode, name, unit in [("srs", "absolute_acceleration", "mps2"), ("pvss", "pseudo_velocity", "mps")]:
        sides = shock.shock_spectrum(frame, freqs=frequencies, damp=0.5 / QUALITY, mode=mode, two_sided=True)
        near(f"{name}, positive", rows[f"{name}_positive_{unit}"], sides.pos["a"])
        near(f"{name}, negative", rows[f"{name}_negative_{unit}"], sides.neg["a"])
        either = shock.shock_spectrum(frame, freqs=frequencies, damp=0.5 / QUALITY, mode=mode)
        near(f"{name}, maximax", rows[f"{name}_maximax_{unit}"], either["a"])
    filters = [
        ("absolute_acceleration", "mps2", shock._absolute_acceleration_coefficients),
        ("pseudo_velocity", "mps", shock._pseudo_velocity_coefficients),
        ("relative_displacement", "m", shock._relative_displacement_coefficients),
    ]
    for name, unit, coefficients in filters:
        for _, row in rows.iterrows():
            omega = 2 * np.pi * row["frequency_hz"]
            b, a = coefficients(omega, QUALITY, 1 / rate)
            period = int(rate / row["frequency_hz"]) + 2
            response = scipy.signal.lfilter(b, a, np.concatenate([signal, np.zeros(period)]))
            primary, residual = (np.max(np.abs(part)) for part in np.split(response, [len(signal)]))
            where = f"{name} at {row['frequency_hz']:.1f} Hz"
            near(f"{where}, primary", row[f"{name}_primary_{unit}"], primary)
            near(f"{where}, residual", row[f"{name}_residual_{unit}"], residual)
            near(f"{where}, maximax", row[f"{name}_maximax_{unit}"], max(primary, residual))

# Mean, scatter and P95/50 over the strikes.
with open("srs.json", encoding="utf-8") as file:
    points = json.load(file)["beads"][0]["points"]
maximax = table.pivot(index="id", columns="frequency_hz", values="absolute_acceleration_maximax_mps2")
count = len(strikes)
factor = scipy.stats.nct.median(count - 1, scipy.stats.norm.ppf(0.95) * np.sqrt(count)) / np.sqrt(count)
logs = np.log(maximax)
near("mean", [point["mean"] for point in points], maximax.mean())
near("deviation", [point["standard_deviation"] for point in points], maximax.std())
near("envelope", [point["envelope"] for point in points], maximax.max())
near("P95/50", [point["upper_95_50"] for point in points], np.exp(logs.mean() + factor * logs.std()))

# Densities by Welch.
for name, window in [("hann", "hann"), ("flat-top", "flattop"), ("rectangular", "boxcar")]:
    table = pd.read_csv(f"psd-{name}.csv")
    for number, signal in enumerate(force):
        rows = of_strike(table, number)
        f, density = scipy.signal.welch(signal, rate, window=window, nperseg=128, detrend=False)
        density = density[np.isin(np.round(f, 3), np.round(rows["frequency_hz"], 3))]
        near(f"density, {name}", rows["force_density_n2_per_hz"], density)

# Fourier transforms, with their phase from the trigger.
table = pd.read_csv("fft.csv")
for number, signal in enumerate(acceleration):
    rows = of_strike(table, number)
    f = np.fft.rfftfreq(len(signal), 1 / rate)
    transform = np.fft.rfft(signal) / rate * np.exp(2j * np.pi * f * origin / rate)
    transform = transform[1 : len(rows) + 1]
    found = rows["acceleration_mps"] * np.exp(1j * rows["phase_rad"])
    near("Fourier transform", found, transform)

# Transfer and coherence: each strike is a segment.
with open("transfer.json", encoding="utf-8") as file:
    points = json.load(file)["beads"][0]["points"]
length = len(force[0])
options = dict(fs=rate, window="boxcar", nperseg=length, noverlap=0, detrend=False)
x, y = np.concatenate(force), np.concatenate(acceleration)
f, cross = scipy.signal.csd(x, y, **options)
_, of_input = scipy.signal.welch(x, **options)
_, coherence = scipy.signal.coherence(x, y, **options)
transfer = (cross / of_input)[1 : len(points) + 1]
found = [point["magnitude"] * np.exp(1j * point["phase_rad"]) for point in points]
near("frequencies", [point["frequency_hz"] for point in points], f[1 : len(points) + 1])
near("transfer", found, transfer)
near("coherence", [point["coherence"] for point in points], coherence[1 : len(points) + 1])

print(f"{len(strikes)} strikes, {len(points)} lines")
