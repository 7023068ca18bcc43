"""CNFSUB and CFFSUB of an Adams CONTACT: a linear spring, and viscous friction."""


def CNFSUB(id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag, iflag):
    return -par[0] * gap


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    return [-par[0] * xdot[0], -par[0] * xdot[1], 0.0]
