"""Solvers that can take many chains at once: diffrax (vmap of Dopri8), and heyoka (Taylor series, in batches)."""

import numpy as np

from chain import ALLOWED_OF_MANY, fit


def diffrax(case, ensemble):
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    n, host = case.bodies, case.host
    # Displacements in 10 μm and energies in μJ, so that all components are of one order.
    unit = 1e-5

    def rate(_, state, intruder):
        mass, spring, damper, inverse = intruder
        u, x, v, w = unit * state[:n], unit * state[n], state[n + 1 : 2 * n + 1], state[2 * n + 1]
        overlap = jnp.maximum(u[:-1] - u[1:], 0.0)
        force = case.stiffness * jnp.sqrt(overlap) * (overlap + case.viscosity * (v[:-1] - v[1:]))
        pull = spring * x + damper * w
        a = jnp.zeros(n).at[:-1].add(-force).at[1:].add(force).at[host].add(pull) * inverse
        lost = jnp.array([1e6 * damper * w * w])
        return jnp.concatenate([v / unit, jnp.array([w / unit]), a, jnp.array([-pull / mass - a[host]]), lost])

    def solve(speed, intruder, tolerance):
        start = jnp.zeros(2 * n + 3).at[n + 1].set(speed)
        solved = diffrax.diffeqsolve(
            diffrax.ODETerm(rate), diffrax.Dopri8(), 0.0, case.duration, 1e-7, start, args=intruder,
            saveat=diffrax.SaveAt(t1=True), max_steps=1_000_000,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance * 1e-2),
        )  # fmt: skip
        return solved.ys[0]

    own = (case.mass, case.spring, case.damper, jnp.array(case.inverse))
    one = jax.jit(lambda tolerance: solve(case.speed, own, tolerance))

    def make(tolerance):
        return lambda: np.asarray(one(tolerance).block_until_ready())

    settings = [(f"tolerance {t:.0e}", t) for t in (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)]
    yield fit(case.name, "diffrax, Dopri8", settings, make, lambda state: case.error(case.velocities(state)))
    if ensemble is None:
        return
    many = jax.jit(jax.vmap(solve, in_axes=(0, (0, 0, 0, 0), None)))
    intruders = (ensemble.mass, ensemble.spring, ensemble.damper, ensemble.inverse)

    def make_many(tolerance):
        return lambda: 1e-6 * np.asarray(many(ensemble.speed, intruders, tolerance).block_until_ready())[:, -1]

    settings = [(f"tolerance {t:.0e}", t) for t in (1e-6, 1e-7, 1e-8, 1e-9)]
    yield fit("ensemble", "diffrax, vmap of Dopri8, all cores", settings, make_many, ensemble.error, ALLOWED_OF_MANY)


def heyoka(case, ensemble):
    import heyoka as hy

    # A Taylor series needs all derivatives of the force, which δ^(3/2) does not have at δ = 0, and that of a chain at rest
    # sees no contact close. So steps have a greatest length, and the error falls as a low power of it.
    n = case.bodies
    u, v = [hy.make_vars(*[f"{name}{j}" for j in range(n)]) for name in "uv"]
    x, w, lost = hy.make_vars("x", "w", "lost")

    def system(mass, spring, damper, inverse):
        total = [hy.expression(0.0)] * n
        for j in range(n - 1):
            overlap = u[j] - u[j + 1]
            closed = hy.gt(overlap, 0.0)
            root = hy.sqrt(hy.select(closed, overlap, 1.0))
            pressed = overlap + case.viscosity * (v[j] - v[j + 1])
            force = hy.select(closed, case.stiffness[j] * root * pressed, 0.0)
            total[j], total[j + 1] = total[j] - force, total[j + 1] + force
        pull = spring * x + damper * w
        total[case.host] = total[case.host] + pull
        a = [total[j] * (inverse if j == case.host else case.inverse[j]) for j in range(n)]
        speeds = [(w, -pull / mass - a[case.host]), (lost, 1e6 * damper * w * w)]
        return list(zip(u, v)) + [(x, w)] + list(zip(v, a)) + speeds

    start = np.append(case.start(), 0.0)
    own = system(case.mass, case.spring, case.damper, case.inverse[case.host])

    def make(longest):
        solver = hy.taylor_adaptive(own, state=start, tol=1e-6, compact_mode=True)

        def run():
            solver.time = 0.0
            solver.state[:] = start
            solver.propagate_until(case.duration, max_delta_t=longest)
            return np.array(solver.state)

        return run

    settings = [(f"order 8, steps of {h:.0e} s at most", h) for h in (1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8)]
    yield fit(case.name, "heyoka, Taylor", settings, make, lambda state: case.error(case.velocities(state)))
    if ensemble is None:
        return
    width = hy.recommended_simd_size()
    parameters = system(*(hy.par[i] for i in range(4)))
    starts = np.zeros((2 * n + 3, ensemble.count))
    starts[n + 1] = ensemble.speed
    values = np.array([ensemble.mass, ensemble.spring, ensemble.damper, ensemble.inverse[:, case.host]])

    def make_many(longest):
        solver = hy.taylor_adaptive_batch(
            parameters, state=starts[:, :width].copy(), pars=values[:, :width].copy(), tol=1e-6, compact_mode=True
        )

        def run():
            absorbed = np.empty(ensemble.count)
            for first in range(0, ensemble.count, width):
                part = slice(first, first + width)
                solver.set_time(0.0)
                solver.state[:], solver.pars[:] = starts[:, part], values[:, part]
                solver.propagate_until(case.duration, max_delta_t=longest)
                absorbed[part] = 1e-6 * solver.state[-1]
            return absorbed

        return run

    settings = [(f"order 8, steps of {h:.0e} s at most", h) for h in (1e-5, 3e-6, 1e-6, 3e-7, 1e-7, 3e-8, 1e-8)]
    name = f"heyoka, Taylor, batches of {width}"
    yield fit("ensemble", name, settings, make_many, ensemble.error, ALLOWED_OF_MANY)
