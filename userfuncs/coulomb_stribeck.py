"""CFFSUB: Coulomb friction with a static peak, smooth through zero slip.

cff_param_string = "USER(mu_static, mu_dynamic, stiction_velocity, friction_velocity)"

The friction coefficient mu over the slip speed v rises by a STEP from 0 at v = 0 to mu_static
at v = vs, falls by a STEP to mu_dynamic at v = vd, and stays there: the curve of COULOMB_ON.
The force is -mu * nforce along the direction of slip, with no torque about the normal.

It has no memory: a body pushed with less than mu_static * nforce creeps slowly.
"""


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    mu_static = par[0]
    mu_dynamic = par[1]
    vs = par[2]
    vd = par[3]

    v = hypot(xdot[0], xdot[1])

    # ratio is mu / v; below vs the STEP from (-vs, -mu_static) to (vs, mu_static), divided
    # by v on paper: nothing is divided by v where v may be 0
    if v <= vs:
        u = v / vs
        ratio = 0.5 * mu_static * (3.0 - u * u) / vs
    elif v < vd:
        [mu, errflg] = py_step(v, vs, mu_static, vd, mu_dynamic, 0)
        py_errmes(errflg, "CFFSUB: py_step could not blend from vs to vd", id, "STOP")
        ratio = mu / v
    else:
        ratio = mu_dynamic / v

    return [-ratio * nforce * xdot[0], -ratio * nforce * xdot[1], 0.0]
