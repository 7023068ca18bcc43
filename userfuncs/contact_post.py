"""CONTACTPOST: a table of contact points, one line an incident and output time.

cpost_fnc_name = "CONTACTPOST" cpost_script_name = "contact_post.py"
cpost_param_string = "USER(1)" prints a line for pairs without incidents too

The table goes to standard error, or wherever the `file` below points.
"""


def CONTACTPOST(id, i_gra_id, j_gra_id, time, par, npar, iflag, endflg):
    if iflag:
        print(
            "# time, contact, graphics I and J, depth, contact point (x, y, z), largest slip speed"
        )
        return
    n, errflg = py_get_ncontacts(id, i_gra_id, j_gra_id)
    if errflg or endflg:
        return
    if n == 0 and npar > 0 and par[0] != 0.0:
        print(f"{time:.6g} {id} {i_gra_id} {j_gra_id} 0")
    net, errflg = py_get_contact_post(id, i_gra_id, j_gra_id, 0)
    for k in range(1, n + 1):
        values, errflg = py_get_contact_post(id, i_gra_id, j_gra_id, k)
        where = " ".join(f"{value:.6g}" for value in values[:4])
        print(f"{time:.6g} {id} {i_gra_id} {j_gra_id} {where} {net[7]:.6g}")
