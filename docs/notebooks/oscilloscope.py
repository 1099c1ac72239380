# %% [markdown]
# # An oscilloscope's record through the bead's arithmetic
#
# `Estimator` runs the integers of the STM32. `digitise` makes codes of a force (N) and an acceleration (m/s²), filtered and with
# noise as the reference front end has them; codes of a converter of your own go to `process` directly. The rows have the columns of
# [bead export](export.md), with `u_…` where the settings state their uncertainties:

# %%
import hertz_chain as hc

run = hc.simulate(hc.Scenario.paper(), rate=1e6)  # in place of the oscilloscope
codes = hc.Estimator.digitise(run["force"][:, 7], run["intruder_acceleration"][:, 0], rate=1e6, seed=1)
strikes = hc.Estimator("docs/scenarios/paper-bead.toml").process(codes)["strikes"]
for name in ("measured", "predicted"):
    energy, u = strikes[f"absorbed_{name}_j"][0], strikes[f"u_absorbed_{name}_j"][0]
    print(f"absorbed, {name}: {1e9 * energy:.1f} ± {2e9 * u:.1f} nJ (2 u)")
