"""CONTACT of an Adams deck by subroutines: in C, and what is wrong with it."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

import mbsim
from helpers.folders import CORPUS
from helpers.libraries import need
from mbsim.errors import DeckError

DECK = (CORPUS / "adams_contact_user.adm").read_text()
SCRIPT = (CORPUS / "contact_by_user.py").read_text()
IN_C = """
void CNFSUB(int *id, double *time, double *par, int *npar, double *loci, double *ni, double *locj,
            double *nj, double *gap, double *gapdot, double *gapdotdot, int *dflag, int *iflag,
            double *result) { *result = -par[0] * *gap; }
"""


def read(folder, text):
    (folder / "contact_by_user.py").write_text(SCRIPT)
    (folder / "deck.adm").write_text(text)
    return mbsim.read_model(folder / "deck.adm")


def test_a_normal_force_in_c_beside_friction_in_python(tmp_path):
    need("gcc")
    (tmp_path / "n.c").write_text(IN_C)
    command = ["gcc", "-shared", "-fPIC", "-o", "n.so", "n.c"]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    both = [DECK, DECK.replace("contact_by_user.py::CNFSUB", "n.so::CNFSUB")]
    how = {"end_time": 0.05, "print_interval": 0.025}
    expected, found = (mbsim.simulate(read(tmp_path, text), **how) for text in both)
    np.testing.assert_allclose(found["requests/1"], expected["requests/1"], atol=1e-9)


WRONG = {
    "contact_by_user.py::CFFSUB": ("other.py::CFFSUB", "FRICTION_ROUTINE"),
    "NORMAL_FUNCTION=USER(40000)": ("IMPACT, STIFFNESS=1, EXPONENT=1", "NORMAL_ROUTINE"),
    "IGEOM=2": ("IGEOM=2, STIFFNESS=1", "belongs to IMPACT; this is by NORMAL_FUNCTION"),
    "JGEOM=1": ("JGEOM=1, IMPACT", "goes without a function of your own"),
}


@pytest.mark.parametrize("right", WRONG)
def test_what_is_wrong_is_said(right, tmp_path):
    wrong, said = WRONG[right]
    (tmp_path / "other.py").write_text(SCRIPT)
    with pytest.raises(DeckError) as caught:
        read(tmp_path, DECK.replace(right, wrong, 1))
    assert said in str(caught.value)
    assert "CONTACT[7]" in str(caught.value)
