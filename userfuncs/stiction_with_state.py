"""CFFSUB with memory: a spring between the surfaces that slips at mu * nforce.

cff_param_string = "USER(mu, stiffness, damping)"

What it keeps is the stretch z of the spring, two numbers, and X at that time. The spring is
stretched by what X has grown since, and where it would pull harder than mu * nforce the rest of
the stretch is slip (return mapping):

    z = z_kept + X - X_kept,      z := z mu N / |k z|  where |k z| > mu N

    F = -k z - s c v,   s = R/sqrt(R^2 + |c v|^2),   R = mu N - |k z|

The damper lets it come to rest. It has no more than R, what the spring leaves of the limit, and so
nothing in slip: a damper that came at once where slip that turns comes to stick would make the
force jump there.

The built-in STICTION has another s: 1 where mu N has room for all of c v, else what it has room
for, and both times 4 r (2 - 4 r) where r = R/(mu N) is less than a quarter. They differ where c v
is not small against R.

Why X alone cannot do it: X says where the surfaces are, not how they came there. A force
-clip(k X, mu N) is that of a spring of limited strength: after a reversal it goes on pulling
towards X = 0, along the motion, and gives back all that it took. Friction turns against the new
motion at once, so that it has to know how far it had slipped; see
`mbsim manual friction-with-memory`.
"""

CFFSUB_STATES = 4  # stretch x, y; X and Y then


def CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag, state):
    mu, k, c = par[0], par[1], par[2]
    limit = mu * nforce
    zx = state[0] + x[0] - state[2]
    zy = state[1] + x[1] - state[3]
    pull = k * hypot(zx, zy)
    if pull >= limit:
        if pull > 0.0:
            zx, zy = zx * limit / pull, zy * limit / pull
        fx, fy = -k * zx, -k * zy
    else:
        room = limit - pull
        damping = c * room / hypot(room, c * hypot(xdot[0], xdot[1]))
        fx, fy = -k * zx - damping * xdot[0], -k * zy - damping * xdot[1]
    return [fx, fy, 0.0], [zx, zy, x[0], x[1]]
