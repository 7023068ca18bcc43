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

  // search: pages with all words, else with most, ranked by title, headings, text
  const known = JSON.parse(box.dataset.words);
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
  function escaped(word) {
    return word.replace(/[.*+?^${}()|[\]\\\/]/g, "\\$&");
  }
  // a word, its plural or synonym where it stands alone; as a part where no page has it so
  function pattern(word) {
    const other = Object.hasOwn(known.synonyms, word) ? known.synonyms[word] : word;
    const either = "(?:" + escaped(word) + "|" + escaped(other) + ")s?";
    const whole = new RegExp("(?<![\\p{L}\\p{N}])" + either + "(?![\\p{L}\\p{N}])", "gu");
    return index.some(function (each) { return each.low.search(whole) >= 0; })
      ? whole : new RegExp(escaped(word), "gu");
  }
  function times(text, word) {
    return (text.match(word) || []).length;
  }
  function look() {
    const typed = box.value.toLowerCase().split(/[\s,;?!]+/).filter(Boolean);
    const telling = typed.filter(function (word) { return !known.empty.includes(word); });
    const asked = telling.length ? telling : typed;
    found.hidden = asked.length === 0;
    contents.hidden = asked.length > 0;
    found.textContent = "";
    if (!asked.length) { return; }
    if (!index) { read(); }
    const words = asked.map(pattern);
    const hits = index.map(function (each) {
      const score = words.reduce(function (sum, word) {
        return sum + 40 * Math.min(1, times(each.title, word)) + 12 * Math.min(2, times(each.heads, word))
          + Math.min(8, times(each.low, word));
      }, 0);
      const together = words.length > 1 && each.heads.split("\n").some(function (head) {
        return words.every(function (word) { return head.search(word) >= 0; });
      });
      const has = words.filter(function (word) { return each.low.search(word) >= 0; });
      const part = each.page.id.startsWith(known.notes) ? 0.2 : 1;
      return { each: each, has: has, score: part * (score + (together ? 60 : 0)) };
    });
    const most = Math.max.apply(null, hits.map(function (hit) { return hit.has.length; }));
    if (!most) { found.textContent = "No page has any of these words."; return; }
    if (most < words.length) { found.textContent = "No page has all of these words; most of them:"; }
    const best = hits.filter(function (hit) { return hit.has.length === most; });
    best.sort(function (a, b) { return b.score - a.score; });
    best.slice(0, 30).forEach(function (hit) { found.appendChild(entry(hit.each, hit.has[0])); });
  }
  function entry(each, word) {
    const line = document.createElement("p");
    const link = document.createElement("a");
    link.href = "#" + each.page.id;
    link.textContent = each.page.dataset.title;
    const near = document.createElement("small");
    const at = each.low.search(word);
    const length = each.low.match(word)[0].length;
    const mark = document.createElement("mark");
    mark.textContent = each.text.slice(at, at + length);
    near.append("…" + each.text.slice(Math.max(0, at - 40), at), mark,
      each.text.slice(at + length, at + length + 60) + "…");
    line.append(link, near);
    return line;
  }
  box.addEventListener("input", look);
  document.addEventListener("keydown", function (event) {
    if (event.key === "/" && document.activeElement !== box) { event.preventDefault(); box.focus(); }
    if (event.key === "Escape" && document.activeElement === box) { box.value = ""; look(); }
  });
})();
