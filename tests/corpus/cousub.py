"""COUSUB, COUXX and COUXX2 as documented: disp(2) = par(1) sin(disp(1))."""

from math import cos, sin


def COUSUB(id, time, par, npar, disp, ndisp, iflag):
    phi = disp[1] - par[0] * sin(disp[0])
    return phi


def COUXX(id, time, par, npar, disp, ndisp, iflag):
    dfda = [-par[0] * cos(disp[0]), 1.0]
    return dfda


def COUXX2(id, time, par, npar, disp, ndisp, iflag):
    dfda2 = ndisp * ndisp * [0.0]
    dfda2[0] = par[0] * sin(disp[0])
    return dfda2


def SCREW(id, time, par, npar, disp, ndisp, iflag):
    """A screw whose pitch changes with its turn: no derivatives are given."""
    return disp[1] + par[0] * disp[0] + par[1] * (1.0 - cos(disp[0]))
