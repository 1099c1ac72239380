"""Combines the inputs of `bead budget --format json` by GTC (MSL New Zealand), and compares the results.

    python budget_by_gtc.py BUDGET.json...
"""

import json
import sys

import GTC

NEAR = 1e-6


def near(name, found, expected):
    assert abs(found - expected) <= NEAR * abs(expected), f"{name}: bead {found!r}, GTC {expected!r}"


def check(name, found, by_gtc):
    near(f"{name}, value", found["value"], by_gtc.x)
    near(f"{name}, u", found["u"], by_gtc.u)
    free = found["degrees_of_freedom"]
    if free is None:
        assert by_gtc.df > 1e6, f"{name}: GTC has {by_gtc.df} degrees of freedom"
    else:
        near(f"{name}, degrees of freedom", free, by_gtc.df)
    factor = GTC.reporting.k_factor(by_gtc.df)
    near(f"{name}, k", found["coverage_factor"], factor)
    near(f"{name}, U", found["expanded"], factor * by_gtc.u)


def budget(bead):
    inputs = []
    of_correlated = {place for pair in bead["correlations"] for place in pair["inputs"]}
    for place, one in enumerate(bead["inputs"]):
        free = one["degrees_of_freedom"]
        free = GTC.inf if free is None else free
        inputs.append(GTC.ureal(one["value"], one["u"], free, independent=place not in of_correlated))
    for pair in bead["correlations"]:
        one, other = pair["inputs"]
        GTC.set_correlation(pair["correlation"], inputs[one], inputs[other])

    def result(name):
        terms = (one[f"sensitivity_{name}"] * (x - one["value"]) for one, x in zip(bead["inputs"], inputs))
        return bead[name]["value"] + sum(terms)

    measured, predicted = result("measured"), result("predicted")
    check("A", bead["measured"], measured)
    check("B", bead["predicted"], predicted)
    check("A - B", bead["difference"], measured - predicted)
    return measured, predicted


for name in sys.argv[1:]:
    with open(name, encoding="utf-8") as file:
        beads = json.load(file)["beads"]
    for bead in beads:
        budget(bead)
        print(f"strike {bead['strike']}: {len(bead['inputs'])} inputs, {len(bead['correlations'])} correlations")
