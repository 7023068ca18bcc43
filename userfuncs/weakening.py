"""CFFSUB: friction of sliding that weakens with speed, for use with cff_type="STICTION".

cff_param_string = "USER(mu, delta)"

    |F| = mu N / (1 + delta |v|)

With STICTION the size of what this returns is the friction of a contact that slips; mu_static says
what holds it. Used alone (cff_type="USERCFF") the force would jump where slip changes its sign.
Source: R. I. Leine, D. H. van Campen, A. de Kraker, L. van den Steen, Nonlinear Dynamics 16 (1998)
41-54.
"""


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag):
    v = hypot(xdot[0], xdot[1])
    pull = par[0] * nforce / (1.0 + par[1] * v)
    if v == 0.0:
        return [-pull, 0.0, 0.0]
    return [-pull * xdot[0] / v, -pull * xdot[1] / v, 0.0]
