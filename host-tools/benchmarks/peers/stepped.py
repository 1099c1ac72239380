"""SciPy's DOP853, and a fourth-order Runge-Kutta method with equal steps, compiled by numba."""

import numpy as np

from chain import ALLOWED_OF_MANY, fit


def scipy(case, _):
    from scipy.integrate import solve_ivp

    n = case.bodies

    def rate(_, state):
        u, x, v, w = state[:n], state[n], state[n + 1 : 2 * n + 1], state[2 * n + 1]
        overlap = np.maximum(u[:-1] - u[1:], 0.0)
        force = case.stiffness * np.sqrt(overlap) * (overlap + case.viscosity * (v[:-1] - v[1:]))
        rate = np.empty_like(state)
        rate[:n], rate[n] = v, w
        a = np.zeros(n)
        a[:-1] -= force
        a[1:] += force
        pull = case.spring * x + case.damper * w
        a[case.host] += pull
        a *= case.inverse
        rate[n + 1 : 2 * n + 1] = a
        rate[2 * n + 1] = -pull / case.mass - a[case.host]
        return rate

    def make(setting):
        rtol, atol = setting
        # Displacements are far smaller than velocities.
        atol = np.concatenate([np.full(n + 1, 1e-5 * atol), np.full(n + 1, atol)])
        span = (0.0, case.duration)
        return lambda: solve_ivp(rate, span, case.start(), method="DOP853", rtol=rtol, atol=atol).y[:, -1]

    settings = [
        (f"rtol {rtol:.0e}, atol {rtol * part:.0e}", (rtol, rtol * part))
        for rtol in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
        for part in (1.0, 1e-2)
    ]
    yield fit(
        case.name, "SciPy, DOP853", settings, make, lambda state: case.error(case.velocities(state))
    )


def rk4():
    import numba

    @numba.njit
    def rate(state, out, stiffness, viscosity, inverse, host, mass, spring, damper):
        n = inverse.size
        before = 0.0
        for j in range(n):
            out[j] = state[n + 1 + j]
            force = 0.0
            if j + 1 < n:
                overlap = state[j] - state[j + 1]
                if overlap > 0.0:
                    closing = state[n + 1 + j] - state[n + 2 + j]
                    force = stiffness[j] * np.sqrt(overlap) * (overlap + viscosity * closing)
            out[n + 1 + j] = (before - force) * inverse[j]
            before = force
        out[n] = state[2 * n + 1]
        pull = spring * state[n] + damper * state[2 * n + 1]
        out[n + 1 + host] += pull * inverse[host]
        out[2 * n + 1] = -pull / mass - out[n + 1 + host]
        # What the damper takes is one more component.
        out[2 * n + 2] = damper * state[2 * n + 1] ** 2

    @numba.njit
    def integrate(start, steps, step, stiffness, viscosity, inverse, host, mass, spring, damper):
        state, argument = start.copy(), np.empty_like(start)
        k1, k2, k3, k4 = np.empty_like(start), np.empty_like(start), np.empty_like(start), np.empty_like(start)
        for _ in range(steps):
            rate(state, k1, stiffness, viscosity, inverse, host, mass, spring, damper)
            for i in range(state.size):
                argument[i] = state[i] + 0.5 * step * k1[i]
            rate(argument, k2, stiffness, viscosity, inverse, host, mass, spring, damper)
            for i in range(state.size):
                argument[i] = state[i] + 0.5 * step * k2[i]
            rate(argument, k3, stiffness, viscosity, inverse, host, mass, spring, damper)
            for i in range(state.size):
                argument[i] = state[i] + step * k3[i]
            rate(argument, k4, stiffness, viscosity, inverse, host, mass, spring, damper)
            for i in range(state.size):
                state[i] += step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
        return state

    @numba.njit
    def absorb(starts, steps, step, stiffness, viscosity, inverse, host, mass, spring, damper):
        lost = np.empty(len(starts))
        for i in range(len(starts)):
            end = integrate(
                starts[i], steps, step, stiffness, viscosity, inverse[i], host, mass[i], spring[i], damper[i]
            )
            lost[i] = end[-1]
        return lost

    return integrate, absorb


def numba(case, ensemble):
    integrate, absorb = rk4()
    n, fixed = case.bodies, (case.stiffness, case.viscosity)

    def make(steps):
        start = np.append(case.start(), 0.0)
        own = (case.inverse, case.host, case.mass, case.spring, case.damper)
        return lambda: integrate(start, steps, case.duration / steps, *fixed, *own)[:-1]

    settings = [(f"{steps} steps", steps) for steps in (1000 * 2**k for k in range(1, 13))]
    yield fit(
        case.name, "numba, RK4 with equal steps", settings, make, lambda state: case.error(case.velocities(state))
    )
    if ensemble is None:
        return
    starts = np.zeros((ensemble.count, 2 * n + 3))
    starts[:, n + 1] = ensemble.speed

    def make_many(steps):
        own = (ensemble.inverse, case.host, ensemble.mass, ensemble.spring, ensemble.damper)
        return lambda: absorb(starts, steps, case.duration / steps, *fixed, *own)

    settings = [(f"{steps} steps", steps) for steps in (1000 * 2**k for k in range(12))]
    yield fit("ensemble", "numba, RK4 with equal steps", settings, make_many, ensemble.error, ALLOWED_OF_MANY)
