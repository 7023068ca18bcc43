"""A SURSUB of the corpus."""


def bowl(id, par, npar, u, v, iord, iflag):
    """Return the point of z = a (x^2 + y^2)."""
    return [u, v, par[0] * (u * u + v * v)]
