"""Discrete frictional contact problems in FCLIB's terms: read, write, judge, solve.

Local problem: find u, r, l with

    u = W r + V l + q,   V' r + R l + s = 0,   K* contains u + mu |u_T| e_N, normal to r in K,

K = {|r_T| <= mu r_N}, so that r_N >= 0 (FCLIB's page writes |r_N|, which would let contacts pull).
Global problem: M v = H r + G l + f, G' v + b = 0, u = H' v + w and the same law.
The order inside a contact is normal, tangent 1, tangent 2 (rolling: then the two rolling axes).

`problem` has the data, `hdf5` the files, `merit` the one definition of the error, `reduction` the
way from global problems and equality constraints to W and q, `solvers/` one method a file, `solve`
the one call for them all.
"""
