# %% [markdown]
# # Fig. 5b of the paper in ten lines
#
# The energy that 0 to 20 intruders leave in a chain without losses, for five masses:

# %%
import hertz_chain as hc
import matplotlib.pyplot as plt

bare = hc.Scenario.paper().replace(duration=0.011, chain={"beads": 60, "relaxation": 0.0}, striker={"velocity": 0.45}, intruder=None)
for mass in (2.7e-3, 4.7e-3, 7.7e-3, 12e-3, 20e-3):
    alike = {"mass": mass, "stiffness": 1e5, "damping": 12.0}
    rows = [bare.replace(intruder=[{"beads": list(range(7, 7 + n)), **alike}]) for n in range(1, 21)]
    runs = hc.ensemble([bare, *rows])
    plt.plot(100 * (1 - runs.absorbed / runs.injected), "o", label=f"{1e3 * mass:.1f} g")
    print(f"{1e3 * mass:.1f} g: one leaves {100 * (1 - runs.absorbed[1] / runs.injected[1]):.2f} %")
plt.gca().set(xlabel="number of intruders", ylabel="energy that stays in the chain (%)", xticks=range(0, 21, 4))
plt.legend()
