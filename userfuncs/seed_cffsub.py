"""The CFFSUB example of the MotionSolve manual page, corrected.

cff_param_string = "USER(0.05,0.01,0.1,0.5)": mu_static, mu_dynamic, stiction and friction
transition velocity.

As printed it does not run. What was wrong, and what was changed:

1. Non-breaking spaces (U+00A0) as indentation and between words: Python takes them for an
   invalid character. Now plain spaces.
2. `result = [000]` at 4 columns and the rest of the body at 8: an unexpected indent. It is
   also a list of one number, so that `result[1] = ...` fails. Now `[0, 0, 0]`.
3. `mu, errflg] = py_step(...)` has no opening bracket. Now `[mu, errflg] = ...`.
4. The two lines that set the result were indented below `else:`; they belong to all three
   branches, or there would be no force at v > vs. Now behind the branches.
5. They divide by v, which is 0 for a body at rest. Now they are skipped at v = 0, where the
   friction force is 0.
"""

# ruff: noqa: RUF059 (errflg stays unread, as in the example)


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    result = [0, 0, 0]

    mu_sta = float(par[0])
    mu_dyn = float(par[1])
    vs = float(par[2])
    vd = float(par[3])

    v = sqrt(xdot[0] * xdot[0] + xdot[1] * xdot[1])
    mu = 0.0
    if v >= vd:
        mu = mu_dyn
    elif v > vs:
        [mu, errflg] = py_step(v, vs, mu_sta, vd, mu_dyn, 0)
    else:
        [mu, errflg] = py_step(v, -vs, -mu_sta, vs, mu_sta, 0)

    if v > 0.0:
        result[0] = -mu * (nforce) * xdot[0] / v
        result[1] = -mu * (nforce) * xdot[1] / v

    return result
