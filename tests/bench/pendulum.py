"""The test of design note 4: 40 hinged rods, one pose a body against joint coordinates.

    python tests/bench/pendulum.py        (needs ../shared/data/references.json)

Prints evaluations a simulated second at a tip error of 9e-6 m, and the cost of one. A
prototype: 3D articulated-body recursion, one DOPRI5 for both forms; nothing of mbsim imports it.
"""

import json
import math
import time
from pathlib import Path

import numpy as np
from numba import njit

FM = dict(cache=True, error_model="numpy", fastmath=False)
IL = dict(inline="always", error_model="numpy")


@njit(**FM)
def rot(qw, qx, qy, qz):
    n = 2.0 / (qw * qw + qx * qx + qy * qy + qz * qz)
    return (
        1 - n * (qy * qy + qz * qz),
        n * (qx * qy - qw * qz),
        n * (qx * qz + qw * qy),
        n * (qx * qy + qw * qz),
        1 - n * (qx * qx + qz * qz),
        n * (qy * qz - qw * qx),
        n * (qx * qz - qw * qy),
        n * (qy * qz + qw * qx),
        1 - n * (qx * qx + qy * qy),
    )


@njit(**FM)
def cr(a, b, c, d, e, f):
    return b * f - c * e, c * d - a * f, a * e - b * d


@njit(**FM)
def qmul(a, b, c, d, e, f, g, h):
    return (
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    )


@njit(**FM)
def qexp(x, y, z):
    t2 = x * x + y * y + z * z
    if t2 < 1e-6:
        s = 0.5 - t2 / 48.0 + t2 * t2 / 3840
        c = 1 - t2 / 8.0 + t2 * t2 / 384
    else:
        t = math.sqrt(t2)
        s = math.sin(0.5 * t) / t
        c = math.cos(0.5 * t)
    return c, s * x, s * y, s * z


# dynamics core. pose: (N,13) x q v w.  Model arrays: par, db (joint P_i in parent frame rel.
# P_parent), cb (com rel. P, own frame), ax, m, Ib(diag)
# Off the manifold each body uses its own rotation and w (acceleration-level constraint). Output
# acc (N,7): a_com, alpha, qdd
@njit(**FM)
def aba(Y, par, db, cb, ax, m, Ib, g, A, W, acc):
    n = Y.shape[0]
    # A: (n,27) = I 0..5 (xx,xy,xz,yy,yz,zz), H 6..14, M 15..20, pn 21..23, pf 24..26
    # W: (n,36): R 0..8, s 9..11, c 12..14, d 15..17, bc 18..20, bf 21..23, Un 24..26, Uf
    # 27..29, D 30, u 31, wwc 32..34
    for i in range(n):
        a, b, c, d, e, f, gg, h, k = rot(Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6])
        W[i, 0] = a
        W[i, 1] = b
        W[i, 2] = c
        W[i, 3] = d
        W[i, 4] = e
        W[i, 5] = f
        W[i, 6] = gg
        W[i, 7] = h
        W[i, 8] = k
        cx = a * cb[i, 0] + b * cb[i, 1] + c * cb[i, 2]
        cy = d * cb[i, 0] + e * cb[i, 1] + f * cb[i, 2]
        cz = gg * cb[i, 0] + h * cb[i, 1] + k * cb[i, 2]
        sx = a * ax[i, 0] + b * ax[i, 1] + c * ax[i, 2]
        sy = d * ax[i, 0] + e * ax[i, 1] + f * ax[i, 2]
        sz = gg * ax[i, 0] + h * ax[i, 1] + k * ax[i, 2]
        wx = Y[i, 10]
        wy = Y[i, 11]
        wz = Y[i, 12]
        p = par[i]
        if p >= 0:
            dx = W[p, 0] * db[i, 0] + W[p, 1] * db[i, 1] + W[p, 2] * db[i, 2]
            dy = W[p, 3] * db[i, 0] + W[p, 4] * db[i, 1] + W[p, 5] * db[i, 2]
            dz = W[p, 6] * db[i, 0] + W[p, 7] * db[i, 1] + W[p, 8] * db[i, 2]
            px = Y[p, 10]
            py = Y[p, 11]
            pz = Y[p, 12]
            qd = sx * (wx - px) + sy * (wy - py) + sz * (wz - pz)
            tx, ty, tz = cr(px, py, pz, sx, sy, sz)
            W[i, 18] = qd * tx
            W[i, 19] = qd * ty
            W[i, 20] = qd * tz
            tx, ty, tz = cr(px, py, pz, dx, dy, dz)
            tx, ty, tz = cr(px, py, pz, tx, ty, tz)
            W[i, 21] = tx
            W[i, 22] = ty
            W[i, 23] = tz
        else:
            dx = db[i, 0]
            dy = db[i, 1]
            dz = db[i, 2]
            W[i, 18] = 0
            W[i, 19] = 0
            W[i, 20] = 0
            W[i, 21] = 0
            W[i, 22] = 0
            W[i, 23] = 0
        W[i, 9] = sx
        W[i, 10] = sy
        W[i, 11] = sz
        W[i, 12] = cx
        W[i, 13] = cy
        W[i, 14] = cz
        W[i, 15] = dx
        W[i, 16] = dy
        W[i, 17] = dz
        I0 = Ib[i, 0]
        I1 = Ib[i, 1]
        I2 = Ib[i, 2]
        ixx = a * a * I0 + b * b * I1 + c * c * I2
        ixy = a * d * I0 + b * e * I1 + c * f * I2
        ixz = a * gg * I0 + b * h * I1 + c * k * I2
        iyy = d * d * I0 + e * e * I1 + f * f * I2
        iyz = d * gg * I0 + e * h * I1 + f * k * I2
        izz = gg * gg * I0 + h * h * I1 + k * k * I2
        Lx = ixx * wx + ixy * wy + ixz * wz
        Ly = ixy * wx + iyy * wy + iyz * wz
        Lz = ixz * wx + iyz * wy + izz * wz
        nx, ny, nz = cr(wx, wy, wz, Lx, Ly, Lz)
        mm = m[i]
        cc = cx * cx + cy * cy + cz * cz
        A[i, 0] = ixx + mm * (cc - cx * cx)
        A[i, 1] = ixy - mm * cx * cy
        A[i, 2] = ixz - mm * cx * cz
        A[i, 3] = iyy + mm * (cc - cy * cy)
        A[i, 4] = iyz - mm * cy * cz
        A[i, 5] = izz + mm * (cc - cz * cz)
        A[i, 6] = 0
        A[i, 7] = -mm * cz
        A[i, 8] = mm * cy
        A[i, 9] = mm * cz
        A[i, 10] = 0
        A[i, 11] = -mm * cx
        A[i, 12] = -mm * cy
        A[i, 13] = mm * cx
        A[i, 14] = 0
        A[i, 15] = mm
        A[i, 16] = 0
        A[i, 17] = 0
        A[i, 18] = mm
        A[i, 19] = 0
        A[i, 20] = mm
        tx, ty, tz = cr(wx, wy, wz, cx, cy, cz)
        tx, ty, tz = cr(wx, wy, wz, tx, ty, tz)
        W[i, 32] = tx
        W[i, 33] = ty
        W[i, 34] = tz
        fx = mm * (tx - g[0])
        fy = mm * (ty - g[1])
        fz = mm * (tz - g[2])
        tx, ty, tz = cr(cx, cy, cz, fx, fy, fz)
        A[i, 21] = nx + tx
        A[i, 22] = ny + ty
        A[i, 23] = nz + tz
        A[i, 24] = fx
        A[i, 25] = fy
        A[i, 26] = fz
    for i in range(n - 1, -1, -1):
        sx = W[i, 9]
        sy = W[i, 10]
        sz = W[i, 11]
        a0 = A[i, 0]
        a1 = A[i, 1]
        a2 = A[i, 2]
        a3 = A[i, 3]
        a4 = A[i, 4]
        a5 = A[i, 5]
        h0 = A[i, 6]
        h1 = A[i, 7]
        h2 = A[i, 8]
        h3 = A[i, 9]
        h4 = A[i, 10]
        h5 = A[i, 11]
        h6 = A[i, 12]
        h7 = A[i, 13]
        h8 = A[i, 14]
        m0 = A[i, 15]
        m1 = A[i, 16]
        m2 = A[i, 17]
        m3 = A[i, 18]
        m4 = A[i, 19]
        m5 = A[i, 20]
        nx = A[i, 21]
        ny = A[i, 22]
        nz = A[i, 23]
        fx = A[i, 24]
        fy = A[i, 25]
        fz = A[i, 26]
        ux = a0 * sx + a1 * sy + a2 * sz
        uy = a1 * sx + a3 * sy + a4 * sz
        uz = a2 * sx + a4 * sy + a5 * sz
        vx = h0 * sx + h3 * sy + h6 * sz
        vy = h1 * sx + h4 * sy + h7 * sz
        vz = h2 * sx + h5 * sy + h8 * sz
        D = sx * ux + sy * uy + sz * uz
        u = -(sx * nx + sy * ny + sz * nz)
        r = 1.0 / D
        W[i, 24] = ux
        W[i, 25] = uy
        W[i, 26] = uz
        W[i, 27] = vx
        W[i, 28] = vy
        W[i, 29] = vz
        W[i, 30] = r
        W[i, 31] = u
        p = par[i]
        if p < 0:
            continue
        qx = ux * r
        qy = uy * r
        qz = uz * r
        ox = vx * r
        oy = vy * r
        oz = vz * r
        a0 -= qx * ux
        a1 -= qx * uy
        a2 -= qx * uz
        a3 -= qy * uy
        a4 -= qy * uz
        a5 -= qz * uz
        h0 -= qx * vx
        h1 -= qx * vy
        h2 -= qx * vz
        h3 -= qy * vx
        h4 -= qy * vy
        h5 -= qy * vz
        h6 -= qz * vx
        h7 -= qz * vy
        h8 -= qz * vz
        m0 -= ox * vx
        m1 -= ox * vy
        m2 -= ox * vz
        m3 -= oy * vy
        m4 -= oy * vz
        m5 -= oz * vz
        bx = W[i, 18]
        by = W[i, 19]
        bz = W[i, 20]
        ex = W[i, 21]
        ey = W[i, 22]
        ez = W[i, 23]
        nx += a0 * bx + a1 * by + a2 * bz + h0 * ex + h1 * ey + h2 * ez + qx * u
        ny += a1 * bx + a3 * by + a4 * bz + h3 * ex + h4 * ey + h5 * ez + qy * u
        nz += a2 * bx + a4 * by + a5 * bz + h6 * ex + h7 * ey + h8 * ez + qz * u
        fx += h0 * bx + h3 * by + h6 * bz + m0 * ex + m1 * ey + m2 * ez + ox * u
        fy += h1 * bx + h4 * by + h7 * bz + m1 * ex + m3 * ey + m4 * ez + oy * u
        fz += h2 * bx + h5 * by + h8 * bz + m2 * ex + m4 * ey + m5 * ez + oz * u
        dx = W[i, 15]
        dy = W[i, 16]
        dz = W[i, 17]
        # H' = H + [d]M ; [d] = (0,-dz,dy; dz,0,-dx; -dy,dx,0)
        g0 = h0 - dz * m1 + dy * m2
        g1 = h1 - dz * m3 + dy * m4
        g2 = h2 - dz * m4 + dy * m5
        g3 = h3 + dz * m0 - dx * m2
        g4 = h4 + dz * m1 - dx * m4
        g5 = h5 + dz * m2 - dx * m5
        g6 = h6 - dy * m0 + dx * m1
        g7 = h7 - dy * m1 + dx * m3
        g8 = h8 - dy * m2 + dx * m4
        # I' = I - H[d] + [d]H'^T ;  (H[d])_ij: col0 = h_.1 dz - h_.2 dy ; col1 = -h_.0
        # dz + h_.2 dx ; col2 = h_.0 dy - h_.1 dx
        # ([d]H'^T)_0j = -dz g_j1 + dy g_j2 ; _1j = dz g_j0 - dx g_j2 ; _2j = -dy g_j0 + dx g_j1
        A[p, 0] += a0 - (h1 * dz - h2 * dy) + (-dz * g1 + dy * g2)
        A[p, 1] += a1 - (-h0 * dz + h2 * dx) + (-dz * g4 + dy * g5)
        A[p, 2] += a2 - (h0 * dy - h1 * dx) + (-dz * g7 + dy * g8)
        A[p, 3] += a3 - (-h3 * dz + h5 * dx) + (dz * g3 - dx * g5)
        A[p, 4] += a4 - (h3 * dy - h4 * dx) + (dz * g6 - dx * g8)
        A[p, 5] += a5 - (h6 * dy - h7 * dx) + (-dy * g6 + dx * g7)
        A[p, 6] += g0
        A[p, 7] += g1
        A[p, 8] += g2
        A[p, 9] += g3
        A[p, 10] += g4
        A[p, 11] += g5
        A[p, 12] += g6
        A[p, 13] += g7
        A[p, 14] += g8
        A[p, 15] += m0
        A[p, 16] += m1
        A[p, 17] += m2
        A[p, 18] += m3
        A[p, 19] += m4
        A[p, 20] += m5
        A[p, 21] += nx + dy * fz - dz * fy
        A[p, 22] += ny + dz * fx - dx * fz
        A[p, 23] += nz + dx * fy - dy * fx
        A[p, 24] += fx
        A[p, 25] += fy
        A[p, 26] += fz
    # forward; accelerations at P stored in A[:,21:27] (alpha, aP)
    for i in range(n):
        p = par[i]
        lx = W[i, 18]
        ly = W[i, 19]
        lz = W[i, 20]
        tx = W[i, 21]
        ty = W[i, 22]
        tz = W[i, 23]
        if p >= 0:
            ax_ = A[p, 21]
            ay_ = A[p, 22]
            az_ = A[p, 23]
            lx += ax_
            ly += ay_
            lz += az_
            ex, ey, ez = cr(ax_, ay_, az_, W[i, 15], W[i, 16], W[i, 17])
            tx += A[p, 24] + ex
            ty += A[p, 25] + ey
            tz += A[p, 26] + ez
        qdd = (
            W[i, 31]
            - W[i, 24] * lx
            - W[i, 25] * ly
            - W[i, 26] * lz
            - W[i, 27] * tx
            - W[i, 28] * ty
            - W[i, 29] * tz
        ) * W[i, 30]
        lx += W[i, 9] * qdd
        ly += W[i, 10] * qdd
        lz += W[i, 11] * qdd
        A[i, 21] = lx
        A[i, 22] = ly
        A[i, 23] = lz
        A[i, 24] = tx
        A[i, 25] = ty
        A[i, 26] = tz
        ex, ey, ez = cr(lx, ly, lz, W[i, 12], W[i, 13], W[i, 14])
        acc[i, 0] = tx + ex + W[i, 32]
        acc[i, 1] = ty + ey + W[i, 33]
        acc[i, 2] = tz + ez + W[i, 34]
        acc[i, 3] = lx
        acc[i, 4] = ly
        acc[i, 5] = lz
        acc[i, 6] = qdd


@njit(**FM)
def kin(th, Y, par, db, cb, ax):
    """joint coordinates (N,2) -> poses (N,13)"""
    n = th.shape[0]
    for i in range(n):
        ha = 0.5 * th[i, 0]
        s = math.sin(ha)
        place(i, Y, par, db, cb, ax, math.cos(ha), s, th[i, 1])


@njit(**FM)
def place(i, Y, par, db, cb, ax, c, s, qd):
    p = par[i]
    if p >= 0:
        qw, qx, qy, qz = qmul(
            Y[p, 3], Y[p, 4], Y[p, 5], Y[p, 6], c, s * ax[i, 0], s * ax[i, 1], s * ax[i, 2]
        )
        a, b, cc, d, e, f, g, h, k = rot(Y[p, 3], Y[p, 4], Y[p, 5], Y[p, 6])
        # vector from parent com to P_i = R_p (db - cb_p)
        ux = db[i, 0] - cb[p, 0]
        uy = db[i, 1] - cb[p, 1]
        uz = db[i, 2] - cb[p, 2]
        dx = a * ux + b * uy + cc * uz
        dy = d * ux + e * uy + f * uz
        dz = g * ux + h * uy + k * uz
        tx, ty, tz = cr(Y[p, 10], Y[p, 11], Y[p, 12], dx, dy, dz)
        Px = Y[p, 0] + dx
        Py = Y[p, 1] + dy
        Pz = Y[p, 2] + dz
        Vx = Y[p, 7] + tx
        Vy = Y[p, 8] + ty
        Vz = Y[p, 9] + tz
        wx = Y[p, 10]
        wy = Y[p, 11]
        wz = Y[p, 12]
    else:
        qw = c
        qx = s * ax[i, 0]
        qy = s * ax[i, 1]
        qz = s * ax[i, 2]
        Px = db[i, 0]
        Py = db[i, 1]
        Pz = db[i, 2]
        Vx = 0.0
        Vy = 0.0
        Vz = 0.0
        wx = 0.0
        wy = 0.0
        wz = 0.0
    a, b, cc, d, e, f, g, h, k = rot(qw, qx, qy, qz)
    sx = a * ax[i, 0] + b * ax[i, 1] + cc * ax[i, 2]
    sy = d * ax[i, 0] + e * ax[i, 1] + f * ax[i, 2]
    sz = g * ax[i, 0] + h * ax[i, 1] + k * ax[i, 2]
    wx += sx * qd
    wy += sy * qd
    wz += sz * qd
    cx = a * cb[i, 0] + b * cb[i, 1] + cc * cb[i, 2]
    cy = d * cb[i, 0] + e * cb[i, 1] + f * cb[i, 2]
    cz = g * cb[i, 0] + h * cb[i, 1] + k * cb[i, 2]
    tx, ty, tz = cr(wx, wy, wz, cx, cy, cz)
    Y[i, 0] = Px + cx
    Y[i, 1] = Py + cy
    Y[i, 2] = Pz + cz
    nn = 1.0 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    Y[i, 3] = qw * nn
    Y[i, 4] = qx * nn
    Y[i, 5] = qy * nn
    Y[i, 6] = qz * nn
    Y[i, 7] = Vx + tx
    Y[i, 8] = Vy + ty
    Y[i, 9] = Vz + tz
    Y[i, 10] = wx
    Y[i, 11] = wy
    Y[i, 12] = wz


@njit(**FM)
def hinge(Y, par, ax, cs):
    """Write cos, sin of half the relative angle and the rate along the axis into cs (N, 3)."""
    n = Y.shape[0]
    for i in range(n):
        p = par[i]
        if p >= 0:
            w, x, y, z = qmul(
                Y[p, 3], -Y[p, 4], -Y[p, 5], -Y[p, 6], Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6]
            )
            wx = Y[i, 10] - Y[p, 10]
            wy = Y[i, 11] - Y[p, 11]
            wz = Y[i, 12] - Y[p, 12]
        else:
            w = Y[i, 3]
            x = Y[i, 4]
            y = Y[i, 5]
            z = Y[i, 6]
            wx = Y[i, 10]
            wy = Y[i, 11]
            wz = Y[i, 12]
        t = x * ax[i, 0] + y * ax[i, 1] + z * ax[i, 2]
        nn = 1.0 / math.sqrt(w * w + t * t)
        a, b, cc, d, e, f, g, h, k = rot(Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6])
        sx = a * ax[i, 0] + b * ax[i, 1] + cc * ax[i, 2]
        sy = d * ax[i, 0] + e * ax[i, 1] + f * ax[i, 2]
        sz = g * ax[i, 0] + h * ax[i, 1] + k * ax[i, 2]
        cs[i, 0] = w * nn
        cs[i, 1] = t * nn
        cs[i, 2] = sx * wx + sy * wy + sz * wz


@njit(**FM)
def project(Y, par, db, cb, ax, cs):
    hinge(Y, par, ax, cs)
    for i in range(Y.shape[0]):
        place(i, Y, par, db, cb, ax, cs[i, 0], cs[i, 1], cs[i, 2])


@njit(**FM)
def gap(Y, par, db, cb, ax):
    """largest joint gap (m), joint velocity gap (m/s), axis angle (rad), quaternion norm defect"""
    g0 = 0.0
    g1 = 0.0
    g2 = 0.0
    g3 = 0.0
    n = Y.shape[0]
    for i in range(n):
        a, b, cc, d, e, f, g, h, k = rot(Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6])
        c = cb[i]
        rx = a * c[0] + b * c[1] + cc * c[2]
        ry = d * c[0] + e * c[1] + f * c[2]
        rz = g * c[0] + h * c[1] + k * c[2]
        sx = a * ax[i, 0] + b * ax[i, 1] + cc * ax[i, 2]
        sy = d * ax[i, 0] + e * ax[i, 1] + f * ax[i, 2]
        sz = g * ax[i, 0] + h * ax[i, 1] + k * ax[i, 2]
        tx, ty, tz = cr(Y[i, 10], Y[i, 11], Y[i, 12], rx, ry, rz)
        Px = Y[i, 0] - rx
        Py = Y[i, 1] - ry
        Pz = Y[i, 2] - rz
        Vx = Y[i, 7] - tx
        Vy = Y[i, 8] - ty
        Vz = Y[i, 9] - tz
        p = par[i]
        if p >= 0:
            a, b, cc, d, e, f, g, h, k = rot(Y[p, 3], Y[p, 4], Y[p, 5], Y[p, 6])
            u = db[i] - cb[p]
            rx = a * u[0] + b * u[1] + cc * u[2]
            ry = d * u[0] + e * u[1] + f * u[2]
            rz = g * u[0] + h * u[1] + k * u[2]
            tx, ty, tz = cr(Y[p, 10], Y[p, 11], Y[p, 12], rx, ry, rz)
            Px -= Y[p, 0] + rx
            Py -= Y[p, 1] + ry
            Pz -= Y[p, 2] + rz
            Vx -= Y[p, 7] + tx
            Vy -= Y[p, 8] + ty
            Vz -= Y[p, 9] + tz
            qx = a * ax[i, 0] + b * ax[i, 1] + cc * ax[i, 2]
            qy = d * ax[i, 0] + e * ax[i, 1] + f * ax[i, 2]
            qz = g * ax[i, 0] + h * ax[i, 1] + k * ax[i, 2]
        else:
            Px -= db[i, 0]
            Py -= db[i, 1]
            Pz -= db[i, 2]
            qx = ax[i, 0]
            qy = ax[i, 1]
            qz = ax[i, 2]
        ex, ey, ez = cr(sx, sy, sz, qx, qy, qz)
        g0 = max(g0, math.sqrt(Px * Px + Py * Py + Pz * Pz))
        g1 = max(g1, math.sqrt(Vx * Vx + Vy * Vy + Vz * Vz))
        g2 = max(g2, math.sqrt(ex * ex + ey * ey + ez * ez))
        g3 = max(g3, abs(math.sqrt(Y[i, 3] ** 2 + Y[i, 4] ** 2 + Y[i, 5] ** 2 + Y[i, 6] ** 2) - 1))
    return g0, g1, g2, g3


@njit(**FM)
def energy(Y, m, Ib, g):
    E = 0.0
    for i in range(Y.shape[0]):
        a, b, c, d, e, f, gg, h, k = rot(Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6])
        wx = Y[i, 10]
        wy = Y[i, 11]
        wz = Y[i, 12]
        bx = a * wx + d * wy + gg * wz
        by = b * wx + e * wy + h * wz
        bz = c * wx + f * wy + k * wz
        E += 0.5 * (Ib[i, 0] * bx * bx + Ib[i, 1] * by * by + Ib[i, 2] * bz * bz) + 0.5 * m[i] * (
            Y[i, 7] ** 2 + Y[i, 8] ** 2 + Y[i, 9] ** 2
        )
        E -= m[i] * (g[0] * Y[i, 0] + g[1] * Y[i, 1] + g[2] * Y[i, 2])
    return E


# kinds: 0 minimal (N,2); 1 maximal, quaternion as 4 numbers; 2 maximal, rotation vector of the
# step (RKMK)
# stage value S = y0 (+) z, z increment (N,13) ; for kind 2 rotation increments are z[3:6]
@njit(**FM)
def compose(kind, y0, z, S):
    n = y0.shape[0]
    if kind == 0:
        for i in range(n):
            S[i, 0] = y0[i, 0] + z[i, 0]
            S[i, 1] = y0[i, 1] + z[i, 1]
    elif kind == 1:
        for i in range(n):
            for j in range(13):
                S[i, j] = y0[i, j] + z[i, j]
    else:
        for i in range(n):
            for j in range(3):
                S[i, j] = y0[i, j] + z[i, j]
            for j in range(7, 13):
                S[i, j] = y0[i, j] + z[i, j]
            a, b, c, d = qexp(z[i, 3], z[i, 4], z[i, 5])
            S[i, 3], S[i, 4], S[i, 5], S[i, 6] = qmul(
                a, b, c, d, y0[i, 3], y0[i, 4], y0[i, 5], y0[i, 6]
            )


@njit(**FM)
def kinrate(kind, S, z, k):
    """fill position rates of k from the velocities in S"""
    for i in range(S.shape[0]):
        k[i, 0] = S[i, 7]
        k[i, 1] = S[i, 8]
        k[i, 2] = S[i, 9]
        wx = S[i, 10]
        wy = S[i, 11]
        wz = S[i, 12]
        if kind == 1:
            a, b, c, d = qmul(0.0, wx, wy, wz, S[i, 3], S[i, 4], S[i, 5], S[i, 6])
            k[i, 3] = 0.5 * a
            k[i, 4] = 0.5 * b
            k[i, 5] = 0.5 * c
            k[i, 6] = 0.5 * d
        else:
            ux = z[i, 3]
            uy = z[i, 4]
            uz = z[i, 5]
            t2 = ux * ux + uy * uy + uz * uz
            if t2 < 1e-4:
                cf = 1 / 12.0 + t2 / 720.0 + t2 * t2 / 30240.0
            else:
                t = math.sqrt(t2)
                cf = (1 - 0.5 * t / math.tan(0.5 * t)) / t2
            ax, ay, az = cr(ux, uy, uz, wx, wy, wz)
            bx, by, bz = cr(ux, uy, uz, ax, ay, az)
            k[i, 3] = wx - 0.5 * ax + cf * bx
            k[i, 4] = wy - 0.5 * ay + cf * by
            k[i, 5] = wz - 0.5 * az + cf * bz
            k[i, 6] = 0.0


@njit(**FM)
def rhs(kind, S, z, k, P, par, db, cb, ax, m, Ib, g, A, W, acc):
    n = S.shape[0]
    if kind == 0:
        kin(S, P, par, db, cb, ax)
        aba(P, par, db, cb, ax, m, Ib, g, A, W, acc)
        for i in range(n):
            k[i, 0] = S[i, 1]
            k[i, 1] = acc[i, 6]
    else:
        aba(S, par, db, cb, ax, m, Ib, g, A, W, acc)
        kinrate(kind, S, z, k)
        for i in range(n):
            for j in range(6):
                k[i, 7 + j] = acc[i, j]


@njit(**FM)
def posediff(Y, Z, L, V, parts):
    """max over bodies of |dx|/L,|dth|,|dv|/V,|dw|L/V between pose sets"""
    for j in range(4):
        parts[j] = 0.0
    for i in range(Y.shape[0]):
        a = (
            math.sqrt(
                (Y[i, 0] - Z[i, 0]) ** 2 + (Y[i, 1] - Z[i, 1]) ** 2 + (Y[i, 2] - Z[i, 2]) ** 2
            )
            / L
        )
        _q0, q1, q2, q3 = qmul(
            Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6], Z[i, 3], -Z[i, 4], -Z[i, 5], -Z[i, 6]
        )
        b = 2 * math.sqrt(q1 * q1 + q2 * q2 + q3 * q3)
        c = (
            math.sqrt(
                (Y[i, 7] - Z[i, 7]) ** 2 + (Y[i, 8] - Z[i, 8]) ** 2 + (Y[i, 9] - Z[i, 9]) ** 2
            )
            / V
        )
        d = (
            math.sqrt(
                (Y[i, 10] - Z[i, 10]) ** 2 + (Y[i, 11] - Z[i, 11]) ** 2 + (Y[i, 12] - Z[i, 12]) ** 2
            )
            * L
            / V
        )
        parts[0] = max(parts[0], a)
        parts[1] = max(parts[1], b)
        parts[2] = max(parts[2], c)
        parts[3] = max(parts[3], d)
    return max(max(parts[0], parts[1]), max(parts[2], parts[3]))


@njit(**FM)
def tip(Y, tb):
    i = Y.shape[0] - 1
    a, b, c, d, e, f, g, h, k = rot(Y[i, 3], Y[i, 4], Y[i, 5], Y[i, 6])
    return (
        Y[i, 0] + a * tb[0] + b * tb[1] + c * tb[2],
        Y[i, 1] + d * tb[0] + e * tb[1] + f * tb[2],
        Y[i, 2] + g * tb[0] + h * tb[1] + k * tb[2],
    )


AT = np.zeros((7, 7))
AT[1, 0] = 1 / 5
AT[2, :2] = [3 / 40, 9 / 40]
AT[3, :3] = [44 / 45, -56 / 15, 32 / 9]
AT[4, :4] = [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]
AT[5, :5] = [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]
AT[6, :6] = [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
ET = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


@njit(**FM)
def stages(kind, y0, h, K, z, S, P, par, db, cb, ax, m, Ib, g, A, W, acc, AT):
    """stages 2..6 and the solution S (z its increment)"""
    n, nc = y0.shape
    for s in range(1, 7):
        for i in range(n):
            for j in range(nc):
                t = 0.0
                for r in range(s):
                    t += AT[s, r] * K[r, i, j]
                z[i, j] = h * t
        compose(kind, y0, z, S)
        if s < 6:
            rhs(kind, S, z, K[s], P, par, db, cb, ax, m, Ib, g, A, W, acc)


# proj: 0 never, 1 project y1 before stage 7 (FSAL exact), 2 project after acceptance + new
# evaluation, 3 project after acceptance, stale k7
# emode (maximal): 0 raw difference, 1 projected difference (tangent), 2 raw, rotation and w only
# emode (minimal): 0 poses, 1 joint values |dq|, |dqd| L/V
@njit(**FM)
def integrate(
    kind,
    proj,
    emode,
    pi,
    y0,
    T,
    ts,
    tol,
    h0,
    hmax,
    L,
    V,
    par,
    db,
    cb,
    ax,
    m,
    Ib,
    g,
    tb,
    AT,
    ET,
    tips,
    gaps,
    stat,
):
    n, nc = y0.shape
    y = y0.copy()
    S = np.zeros_like(y)
    z = np.zeros_like(y)
    e = np.zeros_like(y)
    S2 = np.zeros_like(y)
    z2 = np.zeros_like(y)
    SH = np.zeros_like(y)
    K = np.zeros((7, n, nc))
    KK = np.zeros((7, n, nc))
    P = np.zeros((n, 13))
    P2 = np.zeros((n, 13))
    A = np.zeros((n, 27))
    W = np.zeros((n, 35))
    acc = np.zeros((n, 7))
    cs = np.zeros((n, 3))
    parts = np.zeros(4)
    z[:] = 0
    rhs(kind, y, z, K[0], P, par, db, cb, ax, m, Ib, g, A, W, acc)
    nf = 1
    t = 0.0
    h = h0
    eold = 1e-4
    nacc = 0
    nrej = 0
    it = 0
    last = False
    if kind == 0:
        kin(y, P, par, db, cb, ax)
        E0 = energy(P, m, Ib, g)
    else:
        E0 = energy(y, m, Ib, g)
    dE = 0.0
    dEend = 0.0
    while t < T - 1e-13:
        if h > T - t:
            h = T - t
        if h > hmax:
            h = hmax
        if nacc + nrej > 400000:
            return -1
        stages(kind, y, h, K, z, S, P, par, db, cb, ax, m, Ib, g, A, W, acc, AT)
        nf += 5
        if kind == 1:
            for i in range(n):
                q = 1 / math.sqrt(S[i, 3] ** 2 + S[i, 4] ** 2 + S[i, 5] ** 2 + S[i, 6] ** 2)
                S[i, 3] *= q
                S[i, 4] *= q
                S[i, 5] *= q
                S[i, 6] *= q
        if kind > 0 and (proj == 1):
            for i in range(n):
                for j in range(nc):
                    S2[i, j] = S[i, j]
            project(S, par, db, cb, ax, cs)
        rhs(kind, S, z, K[6], P, par, db, cb, ax, m, Ib, g, A, W, acc)
        nf += 1
        for i in range(n):
            for j in range(nc):
                s = 0.0
                for r in range(7):
                    s += ET[r] * K[r, i, j]
                e[i, j] = h * s
        if kind == 0:
            if emode == 1:
                err = 0.0
                for i in range(n):
                    err = max(err, max(abs(e[i, 0]), abs(e[i, 1]) * L / V))
                parts[3] = err
            else:
                for i in range(n):
                    for j in range(2):
                        SH[i, j] = S[i, j] - e[i, j]
                kin(S, P, par, db, cb, ax)
                kin(SH, P2, par, db, cb, ax)
                err = posediff(P, P2, L, V, parts)
        else:
            # lower-order solution: increment z-e from y
            for i in range(n):
                for j in range(nc):
                    z2[i, j] = z[i, j] - e[i, j]
            compose(kind, y, z2, SH)
            if kind == 1:
                for i in range(n):
                    q = 1 / math.sqrt(SH[i, 3] ** 2 + SH[i, 4] ** 2 + SH[i, 5] ** 2 + SH[i, 6] ** 2)
                    SH[i, 3] *= q
                    SH[i, 4] *= q
                    SH[i, 5] *= q
                    SH[i, 6] *= q
            if emode == 1:
                project(SH, par, db, cb, ax, cs)
                if proj == 1:
                    err = posediff(S, SH, L, V, parts)
                else:
                    for i in range(n):
                        for j in range(nc):
                            z2[i, j] = S[i, j]
                    project(z2, par, db, cb, ax, cs)
                    err = posediff(z2, SH, L, V, parts)
            else:
                if proj == 1:
                    err = posediff(S2, SH, L, V, parts)
                else:
                    err = posediff(S, SH, L, V, parts)
                if emode == 2:
                    err = max(parts[1], parts[3])
        err = max(err / tol, 1e-10)
        for j in range(4):
            if parts[j] / tol >= err * 0.999:
                stat[8 + j] += 1
        if not (err <= 1.0):
            nrej += 1
            last = True
            fac = 0.9 * err ** (-0.2) if err == err else 0.1
            h *= max(0.1, fac)
            continue
        # samples inside (t,t+h] by a separate step from t, not counted
        while it < ts.shape[0] and ts[it] <= t + h * (1 + 1e-12):
            hs = ts[it] - t
            if hs <= 1e-14:
                for i in range(n):
                    for j in range(nc):
                        S2[i, j] = y[i, j]
            else:
                KK[0] = K[0]
                stages(kind, y, hs, KK, z2, S2, P, par, db, cb, ax, m, Ib, g, A, W, acc, AT)
            if kind == 0:
                kin(S2, P, par, db, cb, ax)
            else:
                if proj > 0:
                    project(S2, par, db, cb, ax, cs)
                for i in range(n):
                    for j in range(13):
                        P[i, j] = S2[i, j]
            tips[it, 0], tips[it, 1], tips[it, 2] = tip(P, tb)
            dEend = abs(energy(P, m, Ib, g) - E0)
            dE = max(dE, dEend)
            gaps[it, 0], gaps[it, 1], gaps[it, 2], gaps[it, 3] = gap(P, par, db, cb, ax)
            it += 1
        t += h
        nacc += 1
        if kind > 0 and proj >= 2:
            project(S, par, db, cb, ax, cs)
        for i in range(n):
            for j in range(nc):
                y[i, j] = S[i, j]
                K[0, i, j] = K[6, i, j]
        if kind > 0:
            z[:] = 0.0
            if proj == 2:
                rhs(kind, y, z, K[0], P, par, db, cb, ax, m, Ib, g, A, W, acc)
                nf += 1
            else:
                kinrate(kind, y, z, K[0])
        if pi:
            fac = 0.9 * err ** (-0.17) * eold**0.04
        else:
            fac = 0.9 * err ** (-0.2)
        fac = min(5.0, max(0.2, fac))
        if last:
            fac = min(1.0, fac)
        last = False
        eold = max(err, 1e-4)
        h *= fac
    stat[0] = nf
    stat[1] = nacc
    stat[2] = nrej
    stat[3] = dE
    stat[4] = dEend
    return 0


def chain(N, axes="y", L=2.0):
    length = L / N
    par = np.arange(-1, N - 1)
    db = np.zeros((N, 3))
    db[1:, 0] = length
    cb = np.zeros((N, 3))
    cb[:, 0] = length / 2
    ax = np.zeros((N, 3))
    for i in range(N):
        ax[i, {"x": 0, "y": 1, "z": 2}[axes[i % len(axes)]]] = 1.0
    m = np.ones(N)
    Ib = np.zeros((N, 3))
    Ib[:, 0] = 1e-3 * length * length
    Ib[:, 1] = Ib[:, 2] = length * length / 12
    return par, db, cb, ax, m, Ib, np.array([0.0, 0.0, -9.81]), np.array([length / 2, 0.0, 0.0])


def run(kind, proj, emode, tol, mdl, T=2.0, pi=True, th0=None, dt=0.01, h0=1e-4, hmax=0.05):
    par, db, cb, ax, m, Ib, g, tb = mdl
    N = len(par)
    th = np.zeros((N, 2)) if th0 is None else th0.copy()
    if kind == 0:
        y = th
    else:
        y = np.zeros((N, 13))
        kin(th, y, par, db, cb, ax)
    ts = np.arange(round(T / dt) + 1) * dt
    tips = np.zeros((len(ts), 3))
    gaps = np.zeros((len(ts), 4))
    stat = np.zeros(12)
    L = 2.0
    V = math.sqrt(9.81 * L)
    rc = integrate(
        kind,
        proj,
        emode,
        pi,
        y,
        T,
        ts,
        tol,
        h0,
        hmax,
        L,
        V,
        par,
        db,
        cb,
        ax,
        m,
        Ib,
        g,
        tb,
        AT,
        ET,
        tips,
        gaps,
        stat,
    )
    return rc, tips, gaps, stat


def tip_error(kind, projection, tol, model, exact):
    """Return the largest tip error over 10 ms samples, and evaluations a simulated second."""
    _, tips, _, stat = run(kind, projection, 0, tol, model)
    error = np.hypot(tips[:, 0] - exact[:, 0], tips[:, 2] - exact[:, 1]).max()
    return error, stat[0] / 2


@njit
def many(kind, count, y, z, k, P, par, db, cb, ax, m, Ib, g, A, W, acc):
    for _ in range(count):
        rhs(kind, y, z, k, P, par, db, cb, ax, m, Ib, g, A, W, acc)


def cost(kind, model, count=5000):
    """Return microseconds an evaluation, best of 7, at a random pose on the manifold."""
    par, db, cb, ax, m, Ib, g, _ = model
    n = len(m)
    angles = np.random.default_rng(1).normal(size=(n, 2))
    poses = np.zeros((n, 13))
    kin(angles, poses, par, db, cb, ax)
    y = angles if kind == 0 else poses
    z, k = np.full_like(y, 1e-3), np.zeros_like(y)
    work = np.zeros((n, 13)), np.zeros((n, 27)), np.zeros((n, 35)), np.zeros((n, 7))
    P, A, W, acc = work
    best = math.inf
    for _ in range(8):
        began = time.perf_counter()
        many(kind, count, y, z, k, P, par, db, cb, ax, m, Ib, g, A, W, acc)
        best = min(best, time.perf_counter() - began)
    return 1e6 * best / count


def main():
    data = Path(__file__).resolve().parents[3] / "shared/data/references.json"
    if not data.is_file():
        print(f"{data} is not there: no reference to hold the tip against")
        return
    reference = json.loads(data.read_text())["S8_40"]
    exact = np.array([reference["tip_x"], reference["tip_z"]]).T
    model = chain(40)
    forms = {"joint coordinates": (0, 0), "one pose a body, projected": (1, 1)}
    for name, (kind, projection) in forms.items():
        low, high = 1e-7, 1e-5
        for _ in range(14):
            tol = math.sqrt(low * high)
            error, count = tip_error(kind, projection, tol, model, exact)
            low, high = (low, tol) if error > 9e-6 else (tol, high)
        print(
            f"{name}: {count:.0f} evaluations a simulated second at {error:.1e} m, "
            f"{cost(kind, model):.2f} us an evaluation"
        )


if __name__ == "__main__":
    main()
