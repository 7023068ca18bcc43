"use strict";
(function () {
  const root = document.documentElement;
  const articles = Array.from(document.querySelectorAll("article"));
  const links = Array.from(document.querySelectorAll("#contents a"));
  const found = document.getElementById("found");
  const contents = document.getElementById("contents");
  const box = document.getElementById("search");

  // light or dark: what was chosen, else what the system says
  function kept() {
    try { return localStorage.getItem("mbsim-theme"); } catch (error) { return null; }
  }
  const dark = window.matchMedia("(prefers-color-scheme: dark)");
  function paint() {
    root.dataset.theme = kept() || (dark.matches ? "dark" : "light");
  }
  dark.addEventListener("change", paint);
  document.getElementById("theme").addEventListener("click", function () {
    const next = root.dataset.theme === "dark" ? "light" : "dark";
    try { localStorage.setItem("mbsim-theme", next); } catch (error) { /* a file without storage */ }
    root.dataset.theme = next;
  });
  paint();

  // one page at a time; everything where it is printed
  function show() {
    const id = decodeURIComponent(location.hash.slice(1));
    const aim = (id && document.getElementById(id)) || articles[0];
    const page = aim.closest("article") || articles[0];
    articles.forEach(function (each) { each.classList.toggle("shown", each === page); });
    links.forEach(function (link) {
      const here = link.getAttribute("href") === "#" + page.id;
      link.classList.toggle("here", here);
      if (here && link.closest("details")) { link.closest("details").open = true; }
    });
    const at = articles.indexOf(page);
    const beside = document.getElementById("neighbours");
    beside.textContent = "";
    [[at - 1, "← "], [at + 1, "→ "]].forEach(function (pair) {
      const other = articles[pair[0]];
      const link = document.createElement(other ? "a" : "span");
      if (other) { link.href = "#" + other.id; link.textContent = pair[1] + other.dataset.title; }
      beside.appendChild(link);
    });
    document.title = page.dataset.title + ": mbsim";
    if (aim === page || !id) { window.scrollTo(0, 0); } else { aim.scrollIntoView(); }
  }
  root.classList.add("ready");
  window.addEventListener("hashchange", show);
  show();

  // search: all words, ranked by title, headings, text
  let index = null;
  function read() {
    index = articles.map(function (page) {
      return {
        page: page,
        title: page.dataset.title.toLowerCase(),
        heads: Array.from(page.querySelectorAll("h2, h3")).map(function (each) {
          return each.textContent.toLowerCase();
        }).join("\n"),
        text: page.textContent.replace(/\s+/g, " "),
      };
    });
    index.forEach(function (each) { each.low = each.text.toLowerCase(); });
  }
  function times(text, word) {
    return text.split(word).length - 1;
  }
  function look() {
    const words = box.value.toLowerCase().split(/\s+/).filter(Boolean);
    found.hidden = words.length === 0;
    contents.hidden = words.length > 0;
    found.textContent = "";
    if (!words.length) { return; }
    if (!index) { read(); }
    const hits = index.map(function (each) {
      const score = words.reduce(function (sum, word) {
        return sum + 40 * Math.min(1, times(each.title, word)) + 12 * Math.min(2, times(each.heads, word))
          + Math.min(8, times(each.low, word));
      }, 0);
      const together = words.length > 1 && each.heads.split("\n").some(function (head) {
        return words.every(function (word) { return head.includes(word); });
      });
      const all = words.every(function (word) { return each.low.includes(word); });
      return { each: each, score: all ? score + (together ? 60 : 0) : 0 };
    }).filter(function (hit) { return hit.score > 0; });
    hits.sort(function (a, b) { return b.score - a.score; });
    hits.slice(0, 30).forEach(function (hit) { found.appendChild(entry(hit.each, words[0])); });
    if (!hits.length) { found.textContent = "No page has all of these words."; }
  }
  function entry(each, word) {
    const line = document.createElement("p");
    const link = document.createElement("a");
    link.href = "#" + each.page.id;
    link.textContent = each.page.dataset.title;
    const near = document.createElement("small");
    const at = each.low.indexOf(word);
    const mark = document.createElement("mark");
    mark.textContent = each.text.slice(at, at + word.length);
    near.append("…" + each.text.slice(Math.max(0, at - 40), at), mark,
      each.text.slice(at + word.length, at + word.length + 60) + "…");
    line.append(link, near);
    return line;
  }
  box.addEventListener("input", look);
  document.addEventListener("keydown", function (event) {
    if (event.key === "/" && document.activeElement !== box) { event.preventDefault(); box.focus(); }
    if (event.key === "Escape" && document.activeElement === box) { box.value = ""; look(); }
  });
})();
