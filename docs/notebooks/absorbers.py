# %% [markdown]
# # Which absorbers for my strike
#

# %%
import hertz_chain as hc

scenario = hc.Scenario.load("docs/scenarios/ten-intruders.toml").replace(striker={"velocity": 0.5})
best = hc.optimise(scenario, range(7, 17), total_mass=37e-3, callback=lambda designs, share, descents: designs < 2000)
print(f"{100 * best.share:.2f} % stays in the chain")
for one in best.scenario.to_dict()["intruder"]:
    mass, stiffness, damping = 1e3 * one["mass"], 1e-3 * one["stiffness"], one["damping"]
    print(f"bead {one['beads'][0]}: {mass:.2f} g, {stiffness:.1f} kN/m, {damping:.2f} kg/s")
