"""Fits the ringing of taps by lmfit, and compares values, standard errors and correlation with `bead identify`.

    python identify_by_lmfit.py

In the folder are samples.csv, the table of `bead identify --out`, and identify.json, its result.
"""

import json

import lmfit
import numpy as np
import pandas as pd

result = json.load(open("identify.json"))["beads"][0]
quantities = {one["symbol"]: one for one in result["quantities"]}
mass, bead = quantities["m"]["value"], quantities["M"]["value"]
reduced = mass * (bead - mass) / bead
assert [one["order"] for one in result["noise"] if one["channel"] == "acceleration"] == [0], "the noise is white"
table = pd.read_csv("samples.csv")
strikes = []
for _, rows in table[table["channel"] == "acceleration"].groupby("id"):
    time = rows["time_from_trigger_s"].to_numpy()
    # Before the tap the table has zeros alone.
    start = time[np.argmax(np.diff(time)) + 1]
    strikes.append((time - start, rows["measured"].to_numpy(), rows["noise"].to_numpy()))


def residuals(parameters):
    beta = 0.5 * parameters["c"] / reduced
    omega = np.sqrt(parameters["k"] / reduced - beta**2)
    all_residuals = []
    for number, (time, measured, noise) in enumerate(strikes):
        cos, sin, zero = (parameters[f"{name}{number}"] for name in ("cos", "sin", "zero"))
        decay = np.where(time < 0, 0.0, np.exp(-beta * np.maximum(time, 0)))
        computed = decay * (cos * np.cos(omega * time) + sin * np.sin(omega * time)) + zero
        all_residuals.append((measured - computed) / noise)
    return np.concatenate(all_residuals)


parameters = lmfit.Parameters()
parameters.add("k", value=0.97 * quantities["k"]["value"])
parameters.add("c", value=1.1 * quantities["c"]["value"])
for number in range(len(strikes)):
    parameters.add(f"cos{number}", value=50.0)
    parameters.add(f"sin{number}", value=50.0)
    parameters.add(f"zero{number}", value=0.0)
# Standard errors by the noise, as the model fits.
assert result["goodness"]["error_scale"] == 1.0, result["goodness"]
fit = lmfit.minimize(residuals, parameters, scale_covar=False, xtol=1e-12, ftol=1e-14)
assert fit.success, fit.message

for name in ("k", "c"):
    ours, theirs = quantities[name], fit.params[name]
    off = abs(ours["value"] - theirs.value) / theirs.stderr
    assert off < 1e-2, f"{name}: {ours['value']} and {theirs.value} ± {theirs.stderr}"
    ratio = ours["standard_error"] / theirs.stderr
    assert abs(ratio - 1) < 1e-2, f"{name}: standard errors {ours['standard_error']} and {theirs.stderr}"
correlation = fit.params["k"].correl["c"]
assert abs(correlation - result["correlations"][0][1]) < 1e-2, (correlation, result["correlations"])
assert abs(fit.chisqr / result["goodness"]["chi_squared"] - 1) < 1e-4, (fit.chisqr, result["goodness"])
print(f"{len(strikes)} taps: k, c, their errors and correlation as lmfit has them")
