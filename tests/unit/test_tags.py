"""Every array has a tag, and what is declared as state is in a checkpoint without further ado."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import mbsim
from helpers.fake_run import SETTINGS, add_rows, checkpoint, fake_system
from helpers.folders import MODELS
from mbsim.arrays.scene import Scene
from mbsim.compile_model.build import build
from mbsim.compile_model.tangent import Tangent
from mbsim.core import tags
from mbsim.core.address_forms import GroupType
from mbsim.core.arrays import F1, F2, I1
from mbsim.errors import ModelError
from mbsim.integrators import catalog, scheme
from mbsim.results import identity
from mbsim.results.recorder import Recorder
from mbsim.run import checkpoint as checkpoints


@tags.scratch
class Extra(NamedTuple):
    """A group with a field of every kind."""

    stiffness: tags.Constant[F1]
    slip: tags.State[F2]
    listed: tags.State[I1]
    force: F1


class Wider(NamedTuple):
    """The scene with one group more."""

    bodies: Scene
    extra: Extra


class Untold(NamedTuple):
    """Nobody says what its second field is for."""

    known: tags.State[F1]
    unknown: F1


def leaves(group):
    """Return all arrays of a group of groups."""
    found = []
    for field in group:
        found += leaves(field) if isinstance(field, tuple) else [field]
    return found


@pytest.fixture
def scene():
    return build(mbsim.read_model(MODELS / "stiff" / "four_bar_stop.xml")).scene


def extra():
    return Extra(np.ones(2), np.full((2, 3), 5.0), np.array([4, 7]), np.full(2, 9.0))


@pytest.mark.parametrize("group", [Scene, Tangent, scheme.Workspace, Wider])
def test_every_array_has_one_tag(group):
    found = [tags.layout(group, tag) for tag in tags.Tag]
    assert sum(map(len, found)) == len({name for each in found for name in each})
    assert sum(map(len, found)) > 10


def test_a_field_without_a_tag_is_told():
    with pytest.raises(TypeError, match=r"Untold\.unknown"):
        tags.layout(Untold, tags.STATE)


def test_tags_part_the_arrays_of_a_scene(scene):
    by_tag = [array for tag in tags.Tag for _, array in tags.arrays(scene, tag)]
    assert {id(array) for array in by_tag} == {id(array) for array in leaves(scene)}
    assert len(by_tag) == len(leaves(scene))
    for tag in tags.Tag:
        assert list(tags.layout(Scene, tag)) == [name for name, _ in tags.arrays(scene, tag)]


def test_arrays_are_as_declared(scene):
    for tag in tags.Tag:
        kinds = tags.layout(Scene, tag)
        for name, array in tags.arrays(scene, tag):
            assert kinds[name] == f"{array.dtype}, {array.ndim} axes", name


def test_a_tag_changes_nothing_for_compiled_code():
    fields = GroupType(Extra).fields
    assert [str(kind) for kind, _ in fields.values()] == [
        "array(float64, 1d, C)",
        "array(float64, 2d, C)",
        "array(int64, 1d, C)",
        "array(float64, 1d, C)",
    ]


def test_new_state_is_in_a_checkpoint(scene):
    """A group that only declares its fields is saved, forgotten and put back."""
    method = scheme.make(catalog.load("DOPRI5"), np.zeros(14), 0.0)
    whole = Wider(scene, extra())
    saved = checkpoints.save(whole, method)
    assert {"extra/slip", "extra/listed", "bodies/state/q", "method/y"} <= saved.keys()
    assert not {"extra/stiffness", "extra/force", "method/trial"} & saved.keys()
    for group in (whole, method):
        tags.forget(group, tags.STATE)
        tags.forget(group, tags.SCRATCH)
    assert np.isnan(whole.extra.slip).all()
    assert not whole.extra.listed.any()
    checkpoints.restore(whole, method, saved)
    assert (whole.extra.slip == 5.0).all()
    assert whole.extra.listed.tolist() == [4, 7]
    assert np.isnan(whole.extra.force).all()
    assert (whole.extra.stiffness == 1.0).all()
    for name, array in tags.arrays(whole, tags.STATE):
        np.testing.assert_array_equal(array, saved[name], err_msg=name)


def interrupted(folder):
    """Leave the result file of an interrupted run."""
    system = fake_system(folder / "deck")
    recorder = Recorder(system, SETTINGS, folder)
    add_rows(system, 0, 5)
    recorder.take()
    recorder.flush(checkpoint(5))
    recorder.close("interrupted", {"steps": 5}, system.scene.log.contacts).close()


@pytest.mark.parametrize("change", ["arrays", "form"])
def test_a_checkpoint_with_other_arrays_is_refused(change, tmp_path, monkeypatch):
    interrupted(tmp_path)
    if change == "arrays":
        holds = identity.of_checkpoint()
        added = {"state/strain": "float64, 2 axes"}
        monkeypatch.setattr(identity, "of_checkpoint", lambda: holds | added)
        differs = "state/strain was not there and is float64, 2 axes now"
    else:
        monkeypatch.setattr(identity, "CHECKPOINT", identity.CHECKPOINT + 1)
        differs = f"form was {identity.CHECKPOINT - 1} and is {identity.CHECKPOINT} now"
    said = r"deck\.h5: its checkpoint was written by a version of mbsim with other arrays: .*"
    with pytest.raises(ModelError, match=said) as raised:
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)
    assert differs in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_checkpoint_that_does_not_say_its_arrays_is_refused(tmp_path, monkeypatch):
    """As those of earlier versions."""
    with monkeypatch.context() as patch:
        kinds = {name: kind for name, kind in identity.KINDS.items() if name != "checkpoint"}
        patch.setattr(
            identity.Identity,
            "digests",
            property(lambda self: {kind.attribute: "" for kind in kinds.values()}),
        )
        patch.setattr(identity.Identity, "packed", property(earlier))
        interrupted(tmp_path)
    with pytest.raises(ModelError, match=r"with other arrays; a run goes on as it began"):
        Recorder(fake_system(tmp_path / "deck"), SETTINGS, tmp_path, resume=True)


def earlier(made):
    """Return the facts that earlier versions kept."""
    facts = {kind: known for kind, known in made.facts.items() if kind != "checkpoint"}
    return np.frombuffer(identity.zlib.compress(identity._text(facts), 1), dtype=np.uint8)
