"""Headers of decks: what their solver's switches become, and what is said of it."""

from __future__ import annotations

from pathlib import Path

import pytest

from helpers.folders import ROOT
from mbsim.errors import DeckError
from mbsim.expressions.parse import ExpressionError, parse
from mbsim.reader.xml import read_model
from mbsim.run.settings import settle

MODEL = """<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
<Reference_Marker id="20" body_id="2"/></Model><Command>
{}
</Command></MotionSolve>"""
RUN = '<Simulate end_time="1" num_steps="2"/>'


def read(folder: Path, commands: str):
    (folder / "deck.xml").write_text(MODEL.format(commands), encoding="utf-8")
    return read_model(folder / "deck.xml")


def test_every_switch_is_noted_with_what_is_done_instead() -> None:
    notes = read_model(ROOT / "tests" / "corpus" / "headers.xml").notes
    for words in (
        "constr_tol: positions and velocities are put back onto all constraints",
        "linsolver: linear equations are solved by mbsim's own",
        "max_error: has no effect: mbsim's own search goes on",
        "dae_index: has no effect",
        "h0_max: is less than h_min: the first step is h_min at most",
        "no H3D file is written",
        "a no-break space (U+00A0) is a blank",
    ):
        assert any(words in note for note in notes), words
    (blank,) = (note for note in notes if "U+00A0" in note)
    assert "headers.xml:9: " in blank


def test_the_first_step_is_no_shorter_than_the_shortest(tmp_path: Path) -> None:
    documented = '<Param_Transient h_max="1e-3" h_min="1e-6" h0_max="1e-8"/>'
    (stage,) = settle(read(tmp_path, documented + RUN)).stages
    assert (stage.h_max, stage.h_min, stage.h0_max) == (1e-3, 1e-6, 1e-6)
    (stage,) = settle(read(tmp_path, '<Param_Transient h_min="1e-6"/>' + RUN)).stages
    assert stage.h0_max == 0.0
    with pytest.raises(DeckError, match=r"h_min=.*must not be larger than h_max"):
        read(tmp_path, '<Param_Transient h_max="1e-7" h_min="1e-6"/>' + RUN)


def test_static_over_a_span_is_an_equilibrium_at_each_output_time(tmp_path: Path) -> None:
    static = '<Simulate analysis_type="Static" {}/>'
    span = read(tmp_path, static.format('end_time="1" print_interval="0.4"')).simulations
    assert [each.start_time for each in span] == pytest.approx([0.0, 0.4, 0.8, 1.0])
    assert [each.later for each in span] == [False, True, True, True]
    at_once = static.format('end_time="0." num_steps="1"')
    (single,) = read(tmp_path, at_once).simulations
    assert (single.start_time, single.later) == (0.0, False)
    with pytest.raises(DeckError, match="20000 equilibria"):
        read(tmp_path, static.format('end_time="1" num_steps="20000"'))


def test_contact_by_index_is_no_component() -> None:
    assert parse("CONTACT(301, 1, 4)").root.name != parse("CONTACT(301, 1, 4, 0)").root.name
    with pytest.raises(ExpressionError, match=r"must be 1 in CONTACT\(id, index, rm\)"):
        parse("CONTACT(301, 0, 4)")
