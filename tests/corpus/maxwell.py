"""A spring in series with a damper as an element of one's own."""

ELEMENT_UNKNOWNS = {"maxwell": {"f": 0.0}}


def maxwell(x, xdot, f, fdot, t, par):
    return [fdot[0] / par[0] + f[0] / par[1] - xdot[0]]
