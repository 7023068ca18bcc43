"""The page on adding parts says of each template what the test of the templates counts."""

from __future__ import annotations

import re

import pytest

from helpers.folders import TESTS
from helpers.templates import TEMPLATES
from mbsim.manual.book import page_of


def test_every_template_has_its_section():
    files = {path.stem for path in (TESTS / "templates").glob("*.py")}
    assert files == set(TEMPLATES)
    named = set(re.findall(r"tests/templates/(\w+)\.py", page_of("develop/adding").text))
    assert named == files


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_section_says_where_it_goes_and_how_many_files(name):
    (section,) = (
        part
        for part in page_of("develop/adding").text.split("\n## ")
        if f"tests/templates/{name}.py" in part
    )
    template = TEMPLATES[name]
    assert f"; {template.files} file" in section
    folder = "/".join(["mbsim", *template.place.split("/")[:-1]]) if template.place else "mbsim"
    assert f"`{folder}/" in section
    for path, *_ in template.lines:
        assert f"`mbsim/{path}`" in section
    steps = re.findall(r"(?m)^\d+\. ", section)
    assert 2 <= len(steps) <= 10
