"""The HTML page in a real browser: contents, search, formulas, pictures, light and dark."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import pytest

from mbsim.manual.book import pages
from mbsim.manual.html import document

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
BROWSER = next((path for name in _NAMES if (path := shutil.which(name))), None)
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium on this machine")

#: Asks the page what it shows and leaves the answer in its title's place.
PROBE = """
<script>
(async function () {
  const seen = {};
  const articles = Array.from(document.querySelectorAll("article"));
  const shown = () => articles.filter((each) => getComputedStyle(each).display !== "none");
  const paint = (element) => getComputedStyle(element).backgroundColor;
  seen.theme = document.documentElement.dataset.theme;
  seen.paper = paint(document.body);
  document.getElementById("theme").click();
  seen.otherTheme = document.documentElement.dataset.theme;
  seen.otherPaper = paint(document.body);
  document.getElementById("theme").click();
  const answer = document.createElement("pre");
  answer.id = "answer";
  if (seen.theme === "dark") {  // the rest is the same
    answer.textContent = JSON.stringify(seen);
    document.body.appendChild(answer);
    return;
  }
  seen.shownFirst = shown().map((each) => each.id);
  seen.contents = Array.from(document.querySelectorAll("#contents a"),
    (each) => each.getAttribute("href"));
  seen.pictures = [];
  for (const image of document.images) {
    try { await image.decode(); } catch (error) { seen.pictures.push(image.alt); }
    if (!image.naturalWidth) { seen.pictures.push(image.alt); }
  }
  seen.flat = [];
  seen.wide = [];
  seen.formulas = 0;
  for (const article of articles) {
    location.hash = "#" + article.id;
    await new Promise((done) => setTimeout(done, 0));
    await new Promise((done) => setTimeout(done, 0));
    if (shown().length !== 1 || shown()[0] !== article) { seen.flat.push(article.id); }
    for (const formula of article.querySelectorAll("math")) {
      seen.formulas += 1;
      if (formula.getBoundingClientRect().height < 8) { seen.flat.push(formula.textContent); }
    }
    if (document.documentElement.scrollWidth > window.innerWidth) { seen.wide.push(article.id); }
  }
  const box = document.getElementById("search");
  box.value = "exit codes";
  box.dispatchEvent(new Event("input"));
  seen.hits = Array.from(document.querySelectorAll("#found a"), (each) => each.textContent);
  seen.contentsHidden = document.getElementById("contents").hidden;
  const found = document.getElementById("found");
  const search = (words) => { box.value = words; box.dispatchEvent(new Event("input")); };
  search("sign");
  seen.marked = Array.from(found.querySelectorAll("mark"), (each) => each.textContent);
  search("restart");
  seen.restart = Array.from(found.querySelectorAll("a"), (each) => each.textContent);
  search("qwertz friction");
  seen.most = [found.textContent, found.querySelectorAll("a").length];
  search("qwertz");
  seen.none = found.textContent;
  answer.textContent = JSON.stringify(seen);
  document.body.appendChild(answer);
})();
</script>
"""


def _browse(folder, *arguments):
    """Run the browser without a window and with a profile of its own."""
    common = ("--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}")
    done = subprocess.run(
        [BROWSER, *common, "--window-size=1280,900", "--virtual-time-budget=200000", *arguments],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    folder = tmp_path_factory.mktemp("browser")
    (folder / "manual.html").write_text(
        document().replace("</body>", PROBE + "</body>"), encoding="utf-8"
    )
    answers = {}
    for scheme, setting in (("dark", 0), ("light", 1)):
        # virtual time runs on while pictures are decoded elsewhere: on a busy machine to its end
        for attempt in range(3):
            done = _browse(
                folder / f"{scheme}{attempt}",
                f"--blink-settings=preferredColorScheme={setting}",
                "--enable-logging=stderr",
                "--dump-dom",
                f"file://{folder}/manual.html",
            )
            found = re.search(r'<pre id="answer">(.*?)</pre>', done.stdout, re.DOTALL)
            if found:
                break
        assert found, done.stderr[-2000:]
        text = found.group(1).replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
        answers[scheme] = json.loads(text)
        answers[scheme]["console"] = re.findall(r"CONSOLE.*", done.stderr)
    return answers


def test_it_is_light_or_dark_as_the_system_is(seen):
    assert seen["light"]["theme"] == "light"
    assert seen["dark"]["theme"] == "dark"
    assert seen["light"]["paper"] == seen["dark"]["otherPaper"]
    assert seen["dark"]["paper"] == seen["light"]["otherPaper"]
    assert seen["dark"]["paper"] != seen["light"]["paper"]


def test_one_page_is_shown_and_contents_have_all(seen):
    assert seen["light"]["shownFirst"] == ["index"]
    wanted = {"#" + name.replace("/", ".") for name in pages()}
    assert set(seen["light"]["contents"]) == wanted


def test_pictures_and_formulas_are_seen(seen):
    assert seen["light"]["pictures"] == []
    assert seen["light"]["flat"] == []
    assert seen["light"]["formulas"] > 0


def test_no_page_is_wider_than_the_window(seen):
    assert seen["light"]["wide"] == []


def test_search_finds_pages(seen):
    assert seen["light"]["hits"][0] == "Exit codes"
    assert seen["light"]["contentsHidden"]
    assert "No page has any" in seen["light"]["none"]
    assert {word.lower() for word in seen["light"]["marked"]} <= {"sign", "signs"}
    assert "Questions" in seen["light"]["restart"]
    said, count = seen["light"]["most"]
    assert said.startswith("No page has all")
    assert count > 5


def test_nothing_goes_wrong_in_the_script(seen):
    assert seen["light"]["console"] == []
    assert seen["dark"]["console"] == []
