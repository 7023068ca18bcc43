"""A bowling ball slides, then rolls, under friction of one's own: mu = 0.1 + 0.1 exp(-v)."""

import math

import mbsim


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    slip = math.sqrt(xdot[0] ** 2 + xdot[1] ** 2)
    mu = (0.1 + 0.1 * math.exp(-slip)) * min(1.0, slip / 1e-3)
    pull = -mu * nforce / max(slip, 1e-12)
    return [pull * xdot[0], pull * xdot[1], 0.0]


if __name__ == "__main__":
    model = mbsim.Model()
    ball = model.body(mass=5, inertia=[0.4 * 5 * 0.108**2] * 3, pos=(0, 0, 0.108), v_ic=(5, 0, 0))
    sphere = model.graphic("Sphere", marker=ball, radius=0.108)
    plane = model.graphic("Plane", marker=model.ground)
    law = {"stiffness": 1e7, "damping": 1e3, "dmax": 1e-4, "cff_type": "USERCFF"}
    model.contact(sphere, plane, "IMPACT", cff_fnc_name="CFFSUB", cff_param_string="USER(0)", **law)
    model.gravity(grav=(0, 0, -9.81))
    results = mbsim.simulate(model, end_time=4, print_interval=0.01, plugins=[__file__])
    print(results[f"bodies/{ball}/velocity/x"][-1])
