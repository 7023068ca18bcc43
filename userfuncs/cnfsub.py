"""CNFSUB: a spring of power law with hysteretic damping (Hunt and Crossley's).

cnf_param_string = "USER(stiffness, exponent, damping)"

    F = stiffness * depth^exponent * (1 + damping * closing speed), never below 0

with the depth -gap and the closing speed -gapdot; damping in time / length.
"""


def CNFSUB(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag):
    if gap >= 0.0:
        return 0.0
    force = par[0] * (-gap) ** par[1] * (1.0 - par[2] * gapdot)
    return max(force, 0.0)
